"""Benchmarks that prove the package, by name; each is one file with a function ``run``."""

BENCHMARKS = {
    "alterovitz2003": "the plan beside that of Alterovitz et al. 2003: seconds and error",
    "scaling": "a cold plan, its memory and an insertion as the mesh grows around one corridor",
    "stepping": "a state of a needle in motion, in milliseconds and in back-substitutions",
    "tissue": "a time step of the tissue beside its bare products and its back-substitution",
    "skips": "what a plan does without: time with it and without it, and the difference",
    "solvers": "orders of the factorisation, for definite and for mixed elements",
    "elements": "error against seconds of elements in the reference problems",
    "integrators": "error against seconds of integrators, with elements and kinds of mass",
    "render": "an animation beside the bare PyVista loop that renders the same frames",
    "imports": "the whole plan command from a cold start against importing scikit-fem",
}
