"""Error against seconds of integrators in wave and vibration problems."""

from needlefem.checks import INTEGRATORS
from needlefem.studies import Table
from verification.benchmarks.races import table_of


def run(folder: str) -> Table:
    """Race integrators, with elements and kinds of mass, through the problems of a folder."""
    return table_of(INTEGRATORS, folder)
