"""Benchmarks that a user runs on an own case: costs, as ratios within one run.

A benchmark is one file with a function ``run`` and an entry in `BENCHMARKS`.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.bench.accuracy import OWN, Entrant, race
    from needlefem.bench.insertion import PAPER, alone
    from needlefem.bench.timing import (
        Timed,
        children_seconds,
        in_turn,
        median,
        processor_seconds,
        seconds_of,
        spread_bars,
    )

__all__ = [
    "BENCHMARKS",
    "OWN",
    "PAPER",
    "Entrant",
    "Timed",
    "alone",
    "children_seconds",
    "in_turn",
    "median",
    "processor_seconds",
    "race",
    "seconds_of",
    "spread_bars",
]

BENCHMARKS = {
    "insertion": "one insertion in back-substitutions of its model, and where its time goes",
    "plan": "stages of a plan in milliseconds and in back-substitutions of its own model",
    "accuracy": "error of the placement against seconds of the whole plan, with the front",
}
"""What each benchmark measures, by its name."""

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        accuracy="Entrant OWN race",
        insertion="PAPER alone",
        timing="Timed children_seconds in_turn median processor_seconds seconds_of spread_bars",
    )
