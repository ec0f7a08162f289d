"""Studies: what the answers of a case depend on, as tables. A study is one file and a name."""

from collections.abc import Callable
from importlib import import_module

from needlefem._table import Table
from needlefem.errors import CaseError, nearest
from needlefem.scene import Scene

Study = Callable[[Scene, "Scene | None"], list[Table]]
"""Takes a case and, where it compares two, the other one."""

STUDIES = {
    "accuracy": "20 targets planned to an accuracy: estimate and true error",
    "convergence": "the plan under refinement along the path, for the disc and for a point tip",
    "steps": "a hundred thousand steps with inertia, to and fro: what drifts",
    "cycles": "ten thousand times in and out: what drifts, what memory grows",
    "dynamics": "an insertion with inertia against the march, as the speed goes to zero",
    "elements": "the plan on every element of the catalogue, and on elements half as large",
    "energy": "the energy ledger by two formulas, over path spacings",
    "extremes": "every element under incompressibility, contrast, slivers, needles on mesh lines",
    "friction": "the force to move on after a rest, as steps get shorter, when friction weakens",
    "independence": "the plan against mesh, path spacing, lateral hold and kernel quadrature",
    "paper": "the paper's own method beside ours: placement, drift, noise, time",
    "robust": "the plan carried out on another case, and with other parameters",
    "smoothness": "noise of the map from height to miss and depth",
    "stability": "extreme parameters and meshes, each with a status",
    "targets": "random targets, planned by root and by golden section",
    "trains": "seeds laid on the way back: simulated, and by the shortcut for the first",
}

PAIRED = ("paper", "robust")
"""Those that compare with a second case."""


def study(name: str) -> Study:
    """Return a study by name, or raise a `CaseError` with the nearest name."""
    if name not in STUDIES:
        raise CaseError("study", f"no study '{name}'", nearest(name, STUDIES))
    found: Study = import_module(f"needlefem.studies.{name}").study
    return found
