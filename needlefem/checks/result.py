"""Results of checks."""

import dataclasses
import math
from collections.abc import Sequence

from needlefem.errors import CheckFailedError


@dataclasses.dataclass(frozen=True, kw_only=True)
class CheckResult:
    """Result of one check.

    Parameters
    ----------
    name : str
    requirement : str
        Requirement as a sentence.
    value : float
        Measured value.
    bound : float
        Largest allowed value.
    remedy : str
        What to do if the check fails.
    """

    name: str
    requirement: str
    value: float
    bound: float
    remedy: str = ""

    @property
    def passed(self) -> bool:
        """Whether the value is within the bound (never for NaN)."""
        return self.value <= self.bound


def refuse_failed(checks: Sequence[CheckResult]) -> None:
    """Raise a `CheckFailedError` with the first failed check, if there is one."""
    failed = [check for check in checks if not check.passed]
    if not failed:
        return
    worst = failed[0]
    found = f"gives {worst.value:.3g}, at most {worst.bound:.3g} is allowed"
    if not math.isfinite(worst.value):
        found = "could not be computed: the tissue has no finite response"
    remedy = worst.remedy or "repair the mesh or choose another element"
    raise CheckFailedError(f"refused: check '{worst.name}' {found} ({worst.requirement}); {remedy}")


def outcome(name: str, requirement: str, value: float, bound: float) -> CheckResult:
    """Return the result of a check."""
    return CheckResult(name=name, requirement=requirement, value=float(value), bound=bound)
