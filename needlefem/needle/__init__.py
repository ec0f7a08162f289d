"""The rigid needle: its axis, the kernel of its tip, its contact with the tissue.

Clearances to obstacles along the axis are found here, too.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.needle.clearance import (
        Interval,
        Passing,
        blocked,
        distance,
        gaps,
        merged,
        passings,
    )
    from needlefem.needle.needle_interface import (
        InsertionAxis,
        Kernel,
        NeedleInterface,
        PointKernel,
        TipKernel,
        cross_section,
    )

__all__ = [
    "InsertionAxis",
    "Interval",
    "Kernel",
    "NeedleInterface",
    "Passing",
    "PointKernel",
    "TipKernel",
    "blocked",
    "cross_section",
    "distance",
    "gaps",
    "merged",
    "passings",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        clearance="Interval Passing blocked distance gaps merged passings",
        needle_interface="InsertionAxis Kernel NeedleInterface PointKernel TipKernel cross_section",
    )
