"""Studies that test the package as a whole, by name; each file has a function ``study``."""

STUDIES = {
    "steps": "a hundred thousand steps with inertia, forward and backward: drift",
    "cycles": "ten thousand insertions and retractions: drift, and growth of the memory",
    "dynamics": "an insertion with inertia against path following, as the speed goes to zero",
    "energy": "the energy balance by two formulas, over path spacings",
    "extremes": "every element under incompressibility, contrast, slivers, needles on mesh lines",
    "friction": "the force to move on after a rest, as steps get shorter, when friction weakens",
    "stated_error": "the stated error of the case's own plan against its true error",
    "stability": "extreme parameters and meshes, each with a status",
    "trains": "seeds released during the retraction: simulated, and by the elastic prediction",
}
