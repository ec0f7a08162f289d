"""Planning: from where and how deep to insert, so that the seed ends on the target.

A planner simulates insertions and searches over their offsets. The error estimate says what mesh
and tip kernel do to the placement; a plan is refined until it meets the accuracy that is asked
for. Plans are made with `needlefem.plan`.
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
    from needlefem.planning.reading import InsertionReader, Why, at_jump
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
    "at_jump",
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
        reading="InsertionReader Why at_jump",
        result=(
            "BlockedRelease ErrorEstimate Evidence Headline Plan PlanStatus RefinementStep "
            "RejectedDirection Release headline"
        ),
        search="SearchResult SearchStatus golden_section grid sign_changes signed_root",
    )
