"""Error against seconds of elements in static and modal problems."""

from needlefem.checks import ELEMENTS
from needlefem.studies import Table
from verification.benchmarks.races import table_of


def run(folder: str) -> Table:
    """Race all elements through the reference problems of a folder."""
    return table_of(ELEMENTS, folder)
