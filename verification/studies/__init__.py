"""Studies that test the package as a whole, by name; each file has a function ``study``."""

STUDIES = {
    "steps": "a hundred thousand steps with inertia, to and fro: what drifts",
    "cycles": "ten thousand times in and out: what drifts, what memory grows",
    "dynamics": "an insertion with inertia against the march, as the speed goes to zero",
    "energy": "the energy ledger by two formulas, over path spacings",
    "extremes": "every element under incompressibility, contrast, slivers, needles on mesh lines",
    "friction": "the force to move on after a rest, as steps get shorter, when friction weakens",
    "stated_error": "the stated error of the case's own plan against its true error",
    "stability": "extreme parameters and meshes, each with a status",
    "trains": "seeds laid on the way back: simulated, and by the shortcut for the first",
}
