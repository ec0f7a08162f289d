"""What a check says."""

import dataclasses


@dataclasses.dataclass(frozen=True, kw_only=True)
class CheckResult:
    """The outcome of one check.

    Parameters
    ----------
    name : str
    requirement : str
        What must hold, in a sentence.
    value : float
        What was measured.
    bound : float
        What it may be at most.
    """

    name: str
    requirement: str
    value: float
    bound: float

    @property
    def passed(self) -> bool:
        """Whether the value is within the bound (NaN never is)."""
        return self.value <= self.bound


def outcome(name: str, requirement: str, value: float, bound: float) -> CheckResult:
    """Return a check's result."""
    return CheckResult(name=name, requirement=requirement, value=float(value), bound=bound)
