"""Which element is worth its time: error against seconds in static and modal problems."""

from needlefem.bench.races import table_of
from needlefem.checks.race import ELEMENTS
from needlefem.table import Table


def run(folder: str) -> Table:
    """Race all elements through the reference problems of a folder."""
    return table_of(ELEMENTS, folder)
