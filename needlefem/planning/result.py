"""Result of planning, and its headline with the stated placement error."""

import dataclasses
from collections.abc import Mapping
from enum import StrEnum

from needlefem._arrays import Vector
from needlefem.checks.result import CheckResult
from needlefem.insertion.result import EnergyTerms, Insertion, StrainCheck
from needlefem.insertion.simulation import Discretised
from needlefem.needle.clearance import Passing
from needlefem.planning.search import SearchResult


class PlanStatus(StrEnum):
    """How planning ended; `docs/json.md` describes each value."""

    PLANNED = "planned"
    OUTSIDE_RANGE = "outside_range"
    BLOCKED = "blocked"
    UNREACHABLE = "unreachable"
    BEYOND_MAX_DEPTH = "beyond_max_depth"
    NOT_CONVERGED = "not_converged"
    NOT_ACCURATE = "not_accurate"


@dataclasses.dataclass(frozen=True, eq=False)
class Release:
    """A release in space, and the final position of the seed.

    Parameters
    ----------
    release_point : array, shape (dim,), m
        Position of the tip in space.
    placed_at : array, shape (dim,), m
        Material point at which the seed comes to rest.
    placement_error : float, m
        Distance of the final position from the target.
    note : str
        The reason why there is no better release, if there is one.
    """

    release_point: Vector
    placed_at: Vector
    placement_error: float
    note: str = ""


@dataclasses.dataclass(frozen=True, eq=False)
class BlockedRelease:
    """The best release without obstacles, and the obstacle that blocks it."""

    release: Release
    passing: Passing

    @property
    def sentence(self) -> str:
        """Which obstacle blocks the release."""
        return f"without obstacles the best needle {self.passing}"


@dataclasses.dataclass(frozen=True)
class RejectedDirection:
    """A direction that was not chosen, with status, reason and number of insertions."""

    direction: tuple[float, ...]
    status: PlanStatus
    sentence: str
    insertions: int


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class ErrorEstimate:
    """Estimated placement error of a plan on exact tissue.

    Parameters
    ----------
    error : float, m
        Extrapolated error.
    at_most : float, m
        Stated error: the extrapolated error times a safety factor.
    path : float, m, or None
        Part of the extrapolated error due to the path spacing; None if it is omitted.
    offset : array, shape (dim,), m
        Final position on the finer tissue minus that on the tissue of the plan.
    compared_to : str
        Description of the finer tissue.
    unknowns : int
        Number of unknowns of the finer tissue.
    """

    error: float
    at_most: float
    path: float | None
    offset: Vector
    compared_to: str
    unknowns: int


@dataclasses.dataclass(frozen=True, kw_only=True)
class RefinementStep:
    """A discretization that was tried to reach an accuracy.

    Parameters
    ----------
    element : str
    corridor, contour, bulk, path : float, m
        Element sizes along the needle, at contours and elsewhere; path spacing.
    unknowns : int
    insertions : int
    error : float, m
        Extrapolated placement error.
    at_most : float, m
        Stated error, which is compared with the accuracy.
    """

    element: str
    corridor: float
    contour: float
    bulk: float
    path: float
    unknowns: int
    insertions: int
    error: float
    at_most: float


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Evidence:
    """Checks, estimates and warnings that support or limit a plan.

    Parameters
    ----------
    preflight : tuple of CheckResult
        Checks of the discretization, run before planning.
    energy : EnergyTerms or None
        Energies of the planned insertion.
    validity : StrainCheck or None
        Strains at the planned release.
    estimate : ErrorEstimate or None
        Estimated placement error due to the discretization; None if not requested or not possible.
    refinement_history : tuple of RefinementStep
        Discretizations that were tried to reach `planning.accuracy`. The last is that of the plan.
    missing : mapping
        Reasons why requested quantities are None, by their names in JSON.
    discretisation : Discretised or None
        Summary of the discretization.
    warnings : tuple of str
    skipped, reasons : mapping
        Computations that the scene does not need, and the reasons for automatic choices.
    timings : mapping
        Seconds by stage.
    """

    preflight: tuple[CheckResult, ...]
    energy: EnergyTerms | None
    validity: StrainCheck | None
    estimate: ErrorEstimate | None = None
    refinement_history: tuple[RefinementStep, ...] = ()
    missing: Mapping[str, str] = dataclasses.field(default_factory=dict)
    discretisation: Discretised | None = None
    warnings: tuple[str, ...]
    skipped: Mapping[str, str]
    reasons: Mapping[str, str]
    timings: Mapping[str, float]


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """Result of planning.

    Parameters
    ----------
    status : PlanStatus
    sentence : str
    target : array, shape (dim,), m
    best : Release or None
        The planned release, or the best one of a search without a solution.
    unplanned : Release or None
        Release with the tip at the target in space, as if the tissue were rigid.
    depth_only : Release or None
        Best release at the lateral offset of the target.
    missing : mapping
        Reasons why a release is None, by its name in JSON.
    search : str
        Search method.
    solution : SearchResult
        Lateral offsets that were tried, and their errors.
    insertions : int
        Number of insertions of the search.
    insertion, level : Insertion
        The planned insertion, and that at the lateral offset of the target.
    other_solutions : tuple of float or None
        Further lateral offsets that reach the target (relative to it, m); None if not requested.
    scan_insertions : int
        Number of insertions of the scan for them.
    passings : tuple of Passing
        Distances of the planned needle from the obstacles.
    blocked : BlockedRelease or None
        The best release without obstacles if an obstacle blocks it.
    rejected_directions : tuple of RejectedDirection
        Directions that were not chosen.
    evidence : Evidence or None
        None for `Planner.plan`, which only searches.
    """

    status: PlanStatus
    sentence: str
    target: Vector
    best: Release | None
    unplanned: Release | None
    depth_only: Release | None
    missing: Mapping[str, str] = dataclasses.field(default_factory=dict)
    search: str
    solution: SearchResult
    insertions: int
    insertion: Insertion
    level: Insertion
    other_solutions: tuple[float, ...] | None = None
    scan_insertions: int = 0
    passings: tuple[Passing, ...] = ()
    blocked: BlockedRelease | None = None
    rejected_directions: tuple[RejectedDirection, ...] = ()
    evidence: Evidence | None = None


# Headline of a plan: the stated placement error and its contributions.
#
# A search ends within 1e-8 m of the target on its own model. This is a residual and no estimate of
# the accuracy. The stated placement error is the estimated error of the discretisation times the
# safety factor of `error_estimate` (``at most about``). It does not include the error of small
# strain.


SMALL = 0.01
"""Share of the placement error below which a contribution is not named."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Headline:
    """The stated placement error of a plan, and its contributions.

    Parameters
    ----------
    placement_error : float or None, m
        None if it could not be estimated or was not requested.
    contains : mapping
        Contributions, m: ``mesh`` and ``path`` spacing, each estimated and multiplied by the safety
        factor, and the residual of the ``search``.
    unknown : str
        Reason why the error is None.
    validity : StrainCheck or None
        Strains at the release. The effect of strains beyond the limit is not in the error.
    """

    placement_error: float | None
    contains: Mapping[str, float]
    unknown: str
    validity: StrainCheck | None

    @property
    def error(self) -> str:
        """The placement error with its contributions, such as ``at most about 0.58 mm: mesh``."""
        if self.placement_error is None:
            return f"not estimated: {self.unknown}"
        total = self.placement_error
        text = f"at most about {1e3 * total:.2g} mm"
        named = {name: part for name, part in self.contains.items() if part > SMALL * total}
        if len(named) == 1:
            return f"{text}: {next(iter(named))}"
        parts = ", ".join(f"{name} {1e3 * part:.2g} mm" for name, part in named.items())
        return f"{text}: {parts}" if parts else text

    @property
    def strains(self) -> str:
        """Sentence on strains beyond the limit."""
        if self.validity is None:
            return "strains at the release not computed"
        return f"{self.validity.headline}{', not included' if self.validity.beyond_limit else ''}"

    @property
    def title(self) -> str:
        """Error and strains in the length of a picture title."""
        if self.validity is None or not self.validity.beyond_limit:
            return f"placement error {self.error}"
        size = f"{self.validity.largest_strain:.2g} > {self.validity.strain_limit:g}"
        return f"placement error {self.error}; strains beyond limit ({size}) not included"

    @property
    def sentence(self) -> str:
        """Error and strains as printed after the status."""
        return f"placement error {self.error}; {self.strains}"


def headline(plan: Plan, evidence: Evidence | None = None) -> Headline:
    """Return the headline of a plan.

    Parameters
    ----------
    plan : Plan
    evidence : Evidence, optional
        That of the plan when left out.
    """
    evidence = plan.evidence if evidence is None else evidence
    parts, unknown = _parts(plan, evidence)
    return Headline(
        placement_error=sum(parts.values()) if parts else None,
        contains=parts,
        unknown=unknown,
        validity=None if evidence is None else evidence.validity,
    )


def _parts(plan: Plan, evidence: Evidence | None) -> tuple[dict[str, float], str]:
    """Return the contributions to the placement error, m; or an empty mapping and the reason."""
    if plan.best is None or evidence is None:
        return {}, "nothing is placed" if plan.best is None else "it was not requested"
    if evidence.estimate is None:
        return {}, evidence.missing.get("estimate", "planning.estimate = false")
    known = evidence.estimate
    path = known.at_most * (known.path or 0.0) / known.error if known.error > 0.0 else 0.0
    parts = {"mesh": known.at_most - path, "path": path}
    parts["search"] = plan.best.placement_error
    return {name: part for name, part in parts.items() if part > 0.0}, ""


def with_headline(plan: Plan, evidence: Evidence) -> Plan:
    """Return a plan with its evidence; the headline is the sentence of a successful plan."""
    sentence = plan.sentence
    if plan.status is PlanStatus.PLANNED:
        rest = f"; {plan.blocked.sentence}" if plan.blocked is not None else ""
        sentence = f"{headline(plan, evidence).sentence}{rest}"
    return dataclasses.replace(plan, evidence=evidence, sentence=sentence)
