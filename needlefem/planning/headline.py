"""The first line on a plan: its stated placement error, what that contains, what it does not.

A search ends within 1e-8 m of the target on its own model. That is a residual, not an estimate
of the accuracy: the placement error is that of the discretisation, as far as it was estimated,
times the safety factor of `error_estimate`: it is stated as ``at most about``.
It does not contain strains beyond those that small strain describes.
"""

import dataclasses
from collections.abc import Mapping

from needlefem.insertion.validity import StrainCheck
from needlefem.planning.result import Evidence, Plan, PlanStatus

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
        rest = f"; {plan.barred.sentence}" if plan.barred is not None else ""
        sentence = f"{headline(plan, evidence).sentence}{rest}"
    return dataclasses.replace(plan, evidence=evidence, sentence=sentence)
