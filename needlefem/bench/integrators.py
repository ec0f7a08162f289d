"""Which integrator is worth its time: error against seconds in waves and vibrations."""

from needlefem.bench.races import table_of
from needlefem.checks.race import INTEGRATORS
from needlefem.table import Table


def run(folder: str) -> Table:
    """Race integrators, with elements and kinds of mass, through the problems of a folder."""
    return table_of(INTEGRATORS, folder)
