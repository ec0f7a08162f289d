"""The result of planning, and its headline with the stated placement error."""

import dataclasses
from collections.abc import Mapping
from enum import StrEnum

from needlefem._arrays import Vector
from needlefem.checks.result import CheckResult
from needlefem.insertion.result import EnergyTerms, Insertion
from needlefem.insertion.simulation import Discretised
from needlefem.insertion.strain_check import StrainCheck
from needlefem.needle.clearance import Passing
from needlefem.planning.search import SearchResult


class PlanStatus(StrEnum):
    """How planning ended."""

    PLANNED = "planned"
    OUTSIDE_RANGE = "outside_range"
    BLOCKED = "blocked"
    UNREACHABLE = "unreachable"
    BEYOND_MAX_DEPTH = "beyond_max_depth"
    NOT_CONVERGED = "not_converged"
    NOT_ACCURATE = "not_accurate"


@dataclasses.dataclass(frozen=True, eq=False)
class Release:
    """A release in the world and where the point comes to rest.

    Parameters
    ----------
    release_point : array, shape (dim,), m
        Tip in the world.
    placed_at : array, shape (dim,), m
        Resting place, in the undeformed tissue.
    placement_error : float, m
        Distance of the resting place from the target.
    note : str
        What keeps the needle from a better release, if anything does.
    """

    release_point: Vector
    placed_at: Vector
    placement_error: float
    note: str = ""


@dataclasses.dataclass(frozen=True, eq=False)
class BlockedRelease:
    """The best release without obstacles, and the one that is in its way."""

    release: Release
    passing: Passing

    @property
    def sentence(self) -> str:
        """What obstacles stand in the way of."""
        return f"without obstacles the best needle {self.passing}"


@dataclasses.dataclass(frozen=True)
class RejectedDirection:
    """A direction that was not chosen, why, and how many insertions its search took."""

    direction: tuple[float, ...]
    status: PlanStatus
    sentence: str
    insertions: int


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class ErrorEstimate:
    """How far from the target the release would place on the exact tissue; an estimate.

    Parameters
    ----------
    error : float, m
        As extrapolated.
    at_most : float, m
        The stated error: the extrapolated one times a safety factor.
    path : float, m, or None
        What the path's spacing has in the extrapolated one; None where it is left out.
    offset : array, shape (dim,), m
        Where it places on the finer tissue, less where on the plan's own.
    compared_to : str
        The finer tissue.
    unknowns : int
        It has.
    """

    error: float
    at_most: float
    path: float | None
    offset: Vector
    compared_to: str
    unknowns: int


@dataclasses.dataclass(frozen=True, kw_only=True)
class RefinementStep:
    """A discretisation that was tried for an accuracy.

    Parameters
    ----------
    element : str
    corridor, contour, bulk, path : float, m
        Element sizes along the needle, at contours and elsewhere; path spacing.
    unknowns : int
    insertions : int
    error : float, m
        Estimate of the placement's error, as extrapolated.
    at_most : float, m
        The stated error, which is compared with the accuracy.
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
    """What speaks for and against a plan.

    Parameters
    ----------
    preflight : tuple of CheckResult
        Checks of the very discretisation, run before planning.
    ledger : EnergyTerms or None
        Energies of the planned insertion.
    validity : StrainCheck or None
        Strains at the planned release.
    estimate : ErrorEstimate or None
        Of the placement's discretisation error; None if it was not asked for or can't be had.
    trail : tuple of RefinementStep
        Discretisations tried for `planning.accuracy`; the plan is the last one's.
    missing : mapping
        Why something is None that was asked for, by its name in JSON.
    discretisation : Discretised or None
        What the plan was made on.
    warnings : tuple of str
    skipped, reasons : mapping
        What the scene did without, and why it was resolved as it was.
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
    """The outcome of planning.

    Parameters
    ----------
    status : PlanStatus
    sentence : str
    target : array, shape (dim,), m
    best : Release or None
        The planned release (the best one tried, if none solved the search).
    unplanned : Release or None
        Released with the tip at the target in the world, as if nothing moved.
    depth_only : Release or None
        At the target's height, at the best depth.
    missing : mapping
        Why a release is None, by its name in JSON.
    search : str
        Which search was used.
    solution : SearchResult
        Heights tried and what they missed by.
    insertions : int
        Insertions spent on the search.
    insertion, level : Insertion
        The planned insertion, and that at the target's height.
    other_solutions : tuple of float or None
        Further heights that hit the target (relative to it, m); None if not asked for.
    scan_insertions : int
        Insertions spent on looking for them.
    passings : tuple of Passing
        How near the planned needle comes to the obstacles.
    barred : BlockedRelease or None
        What obstacles stand in the way of; None if of nothing.
    refusals : tuple of RejectedDirection
        Directions that were tried before this one.
    evidence : Evidence or None
        None from `Planner.plan`, which only searches.
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
"""Part of the whole below which a contribution to the placement error is not named."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Headline:
    """The stated placement error of a plan, and what it contains.

    Parameters
    ----------
    placement_error : float or None, m
        None where it could not be estimated or was not asked for.
    contains : mapping
        Its parts, m: ``mesh`` and ``path`` spacing, each as estimated times the safety factor, and
        what the ``search`` left.
    unknown : str
        Why there is none.
    validity : StrainCheck or None
        Strains at the release: what those beyond the limit do to the placement is in no number.
    """

    placement_error: float | None
    contains: Mapping[str, float]
    unknown: str
    validity: StrainCheck | None

    @property
    def error(self) -> str:
        """The placement error with its parts, such as ``at most about 0.58 mm: mesh``."""
        if self.placement_error is None:
            return f"not estimated: {self.unknown}"
        whole = self.placement_error
        said = f"at most about {1e3 * whole:.2g} mm"
        told = {name: part for name, part in self.contains.items() if part > SMALL * whole}
        if len(told) == 1:
            return f"{said}: {next(iter(told))}"
        parts = ", ".join(f"{name} {1e3 * part:.2g} mm" for name, part in told.items())
        return f"{said}: {parts}" if parts else said

    @property
    def strains(self) -> str:
        """What is said of strains beyond the limit."""
        if self.validity is None:
            return "strains at the release not known"
        return f"{self.validity.headline}{', not included' if self.validity.beyond_limit else ''}"

    @property
    def title(self) -> str:
        """Both, as short as a picture's title."""
        if self.validity is None or not self.validity.beyond_limit:
            return f"placement error {self.error}"
        size = f"{self.validity.largest_strain:.2g} > {self.validity.strain_limit:g}"
        return f"placement error {self.error}; strains beyond limit ({size}) not included"

    @property
    def sentence(self) -> str:
        """Both, as they stand behind the status."""
        return f"placement error {self.error}; {self.strains}"


def headline(plan: Plan, evidence: Evidence | None = None) -> Headline:
    """Return the headline of a plan.

    Parameters
    ----------
    plan : Plan
    evidence : Evidence, optional
        The plan's own when left out.
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
    """Return the parts of the placement error, m; none, and why, where it is not known."""
    if plan.best is None or evidence is None:
        return {}, "nothing is placed" if plan.best is None else "no evidence was asked for"
    if evidence.estimate is None:
        return {}, evidence.missing.get("estimate", "planning.estimate = false")
    known = evidence.estimate
    path = known.at_most * (known.path or 0.0) / known.error if known.error > 0.0 else 0.0
    parts = {"mesh": known.at_most - path, "path": path}
    parts["search"] = plan.best.placement_error
    return {name: part for name, part in parts.items() if part > 0.0}, ""


def with_headline(plan: Plan, evidence: Evidence) -> Plan:
    """Return a plan with its evidence; the sentence of one that succeeded is its headline."""
    sentence = plan.sentence
    if plan.status is PlanStatus.PLANNED:
        rest = f"; {plan.blocked.sentence}" if plan.blocked is not None else ""
        sentence = f"{headline(plan, evidence).sentence}{rest}"
    return dataclasses.replace(plan, evidence=evidence, sentence=sentence)
