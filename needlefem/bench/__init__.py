"""Benchmarks that a user runs on an own case: costs, as ratios within one run.

A benchmark is one file with a function ``run`` and an entry in `BENCHMARKS`.
"""

BENCHMARKS = {
    "insertion": "one insertion in back-substitutions of its model, and where its time goes",
    "plan": "stages of a plan in milliseconds and in back-substitutions of its own model",
    "accuracy": "error of the placement against seconds of the whole plan, with the front",
}
