"""Studies that a user runs on an own case: tables that show what its results depend on.

A study is one file with a function ``study`` and an entry in `STUDIES`.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports
from needlefem._table import Table

if TYPE_CHECKING:
    from needlefem.studies.targets import TargetTable, draw_targets, target_table

__all__ = ["STUDIES", "Table", "TargetTable", "draw_targets", "target_table"]

STUDIES = {
    "accuracy": "20 targets planned to an accuracy: estimate and true error",
    "convergence": "the plan under refinement along the path, for the disc and for a point tip",
    "elements": "the plan on every element of the catalogue, and on elements half as large",
    "independence": "the plan against mesh, path spacing, lateral penalty and kernel quadrature",
    "robust": "the plan carried out on another case, and with other parameters",
    "smoothness": "numerical noise of lateral error and depth as functions of the lateral offset",
    "targets": "random targets, planned by root and by golden section",
}
"""Description of each study by its name."""

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        targets="TargetTable draw_targets target_table",
    )
