"""Which integrator is worth its time: error against seconds in waves and vibrations."""

from needlefem._table import Table
from needlefem.checks.work_precision import INTEGRATORS
from verification.benchmarks.races import table_of


def run(folder: str) -> Table:
    """Race integrators, with elements and kinds of mass, through the problems of a folder."""
    return table_of(INTEGRATORS, folder)
