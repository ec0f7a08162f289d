"""Planning: the entry and depth at which a seed has to be released to come to rest at the target.

A planner simulates insertions and searches over their lateral offsets. The error estimate is the
effect of the mesh and the tip kernel on the final position. A plan is refined until the stated
error is at most the requested accuracy. Plans are made with `needlefem.plan`.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.planning.adaptive import (
        MeshSizes,
        ReferenceSolution,
        placed_on,
        reference,
        true_error,
    )
    from needlefem.planning.error_estimate import (
        NoEstimateError,
        displacement_on,
        estimate,
        finer_tissue,
        path_error,
    )
    from needlefem.planning.planner import Planner, carry_out
    from needlefem.planning.reading import InsertionReader, Why, at_rupture
    from needlefem.planning.result import (
        BlockedRelease,
        ErrorEstimate,
        Evidence,
        Headline,
        Plan,
        PlanStatus,
        RefinementStep,
        RejectedDirection,
        Release,
        headline,
    )
    from needlefem.planning.search import (
        SearchResult,
        SearchStatus,
        golden_section,
        grid,
        sign_changes,
        signed_root,
    )

__all__ = [
    "BlockedRelease",
    "ErrorEstimate",
    "Evidence",
    "Headline",
    "InsertionReader",
    "MeshSizes",
    "NoEstimateError",
    "Plan",
    "PlanStatus",
    "Planner",
    "ReferenceSolution",
    "RefinementStep",
    "RejectedDirection",
    "Release",
    "SearchResult",
    "SearchStatus",
    "Why",
    "at_rupture",
    "carry_out",
    "displacement_on",
    "estimate",
    "finer_tissue",
    "golden_section",
    "grid",
    "headline",
    "path_error",
    "placed_on",
    "reference",
    "sign_changes",
    "signed_root",
    "true_error",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        adaptive="MeshSizes ReferenceSolution placed_on reference true_error",
        error_estimate="NoEstimateError displacement_on estimate finer_tissue path_error",
        planner="Planner carry_out",
        reading="InsertionReader Why at_rupture",
        result=(
            "BlockedRelease ErrorEstimate Evidence Headline Plan PlanStatus RefinementStep "
            "RejectedDirection Release headline"
        ),
        search="SearchResult SearchStatus golden_section grid sign_changes signed_root",
    )
