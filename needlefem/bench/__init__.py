"""Benchmarks: what things cost, as ratios within one run. A benchmark is one file and a name."""

from collections.abc import Callable
from importlib import import_module

from needlefem._table import Table
from needlefem.errors import CaseError, nearest

Benchmark = Callable[[str], Table]
"""Takes the path of a case, or of the folder of reference problems."""

BENCHMARKS = {
    "insertion": "one insertion in back-substitutions of its model, and where its time goes",
    "scaling": "a cold plan, its memory and an insertion as the mesh grows around one corridor",
    "plan": "stages of a plan in milliseconds and in back-substitutions of its own model",
    "stepping": "a state of a needle in motion, in milliseconds and in back-substitutions",
    "tissue": "a time step of the tissue beside its bare products and its back-substitution",
    "skips": "what a plan does without: time with it and without it, and the difference",
    "solvers": "orders of the factorisation, for definite and for mixed elements",
    "elements": "error against seconds of elements in the reference problems",
    "integrators": "error against seconds of integrators, with elements and kinds of mass",
    "accuracy": "error of the placement against seconds of the whole plan, with the front",
    "render": "an animation beside the bare PyVista loop that renders the same frames",
    "imports": "the whole plan command from a cold start against importing scikit-fem",
}


def benchmark(name: str) -> Benchmark:
    """Return a benchmark by name, or raise a `CaseError` with the nearest name."""
    if name not in BENCHMARKS:
        raise CaseError("benchmark", f"no benchmark '{name}'", nearest(name, BENCHMARKS))
    found: Benchmark = import_module(f"needlefem.bench.{name}").run
    return found
