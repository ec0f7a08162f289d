"""Fields that know their unit, range and meaning: each parameter is declared once."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any


@dataclasses.dataclass(frozen=True)
class ParameterInfo:
    """What stands beside a field: sentence, dimension (see `units`) and admissible range.

    `low` and `high` are exclusive unless `closed` says that the bound itself is admissible.
    `refused` says of words that are known elsewhere why they are no choice here.
    """

    sentence: str
    dimension: str | None = None
    low: float = -math.inf
    high: float = math.inf
    closed: bool = False
    choices: tuple[str, ...] = ()
    refused: Mapping[str, str] = dataclasses.field(default_factory=dict)

    def admits(self, value: float) -> bool:
        """Say whether a number lies in the range (NaN and infinity never do)."""
        if isinstance(value, float) and not math.isfinite(value):
            return False
        if self.closed:
            return self.low <= value <= self.high
        return self.low < value < self.high

    def range_text(self) -> str:
        """Describe the range in words, in SI units."""
        word = "at least" if self.closed else "above"
        under = "at most" if self.closed else "below"
        low = f"{word} {self.low:g}" if math.isfinite(self.low) else ""
        high = f"{under} {self.high:g}" if math.isfinite(self.high) else ""
        return " and ".join(part for part in (low, high) if part) or "finite"


def parameter(
    sentence: str,
    dimension: str | None = None,
    *,
    default: Any = dataclasses.MISSING,
    low: float = -math.inf,
    high: float = math.inf,
    closed: bool = False,
    choices: tuple[str, ...] = (),
    refused: Mapping[str, str] | None = None,
) -> Any:
    """Return a dataclass field that carries a `ParameterInfo`."""
    metadata = {
        "parameter": ParameterInfo(sentence, dimension, low, high, closed, choices, refused or {})
    }
    if default is dataclasses.MISSING:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def parameter_info(field: "dataclasses.Field[Any]") -> ParameterInfo | None:
    """Return the `ParameterInfo` of a field, or None for a plain field."""
    found = field.metadata.get("parameter")
    return found if isinstance(found, ParameterInfo) else None
