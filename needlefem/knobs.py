"""Fields that know their unit, range and meaning: each knob is declared once."""

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

from needlefem.errors import CaseError


@dataclasses.dataclass(frozen=True)
class Knob:
    """What stands beside a field: sentence, dimension (see `units`) and admissible range.

    `low` and `high` are exclusive unless `closed` says that the bound itself is admissible.
    """

    sentence: str
    dimension: str | None = None
    low: float = -math.inf
    high: float = math.inf
    closed: bool = False
    choices: tuple[str, ...] = ()

    def admits(self, value: float) -> bool:
        """Say whether a number lies in the range (NaN and infinity never do)."""
        if not math.isfinite(value):
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


def knob(
    sentence: str,
    dimension: str | None = None,
    *,
    default: Any = dataclasses.MISSING,
    low: float = -math.inf,
    high: float = math.inf,
    closed: bool = False,
    choices: tuple[str, ...] = (),
) -> Any:
    """Return a dataclass field that carries a `Knob`."""
    metadata = {"knob": Knob(sentence, dimension, low, high, closed, choices)}
    if default is dataclasses.MISSING:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def knob_of(field: "dataclasses.Field[Any]") -> Knob | None:
    """Return the `Knob` of a field, or None for a plain field."""
    found = field.metadata.get("knob")
    return found if isinstance(found, Knob) else None


def check_ranges(instance: Any, prefix: str = "") -> None:
    """Raise a `CaseError` for the first field of a dataclass outside its declared range."""
    for field in dataclasses.fields(instance):
        declared = knob_of(field)
        if declared is not None:
            _check_value(getattr(instance, field.name), declared, prefix + field.name)


def _check_value(value: Any, declared: Knob, key: str) -> None:
    if isinstance(value, str) and declared.choices and value not in declared.choices:
        raise CaseError(key, f"'{value}' is not known", "one of " + ", ".join(declared.choices))
    for number in _numbers(value):
        if not declared.admits(number):
            problem = f"{number:g} is out of range"
            raise CaseError(key, problem, f"it must be {declared.range_text()} (SI units)")


def _numbers(value: Any) -> Iterator[float]:
    if isinstance(value, bool):
        return
    if isinstance(value, int | float):
        yield float(value)
    elif isinstance(value, tuple):
        for item in value:
            yield from _numbers(item)
