"""Studies that a user runs on an own case: what its answers depend on, as tables.

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
    "independence": "the plan against mesh, path spacing, lateral hold and kernel quadrature",
    "robust": "the plan carried out on another case, and with other parameters",
    "smoothness": "noise of the map from height to miss and depth",
    "targets": "random targets, planned by root and by golden section",
}
"""What each study measures, by its name."""

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        targets="TargetTable draw_targets target_table",
    )
