"""Dataclass fields with unit, range and description, and their validation.

A dataclass that is derived from `Validated` checks its fields when an instance is created. A case
file, ``--set``, `needlefem.scene.vary`, `dataclasses.replace` and a constructor therefore raise the
same `CaseError` for the same value. The admissible values of a field follow from its type
annotation and its `ParameterInfo`.
"""

import dataclasses
import math
import numbers
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np

from needlefem.errors import CaseError, matching, nearest, short
from needlefem.units import LARGEST, dimension_of, parse_quantity

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T")
D = TypeVar("D", bound="DataclassInstance")


@dataclasses.dataclass(frozen=True)
class ParameterInfo:
    """Description, dimension (see `units`) and admissible range of a field.

    The bounds `low` and `high` are exclusive unless `closed` is true. `refused` contains words that
    are known elsewhere but are no choice here, each with the reason.
    """

    sentence: str
    dimension: str | None = None
    low: float = -math.inf
    high: float = math.inf
    closed: bool = False
    choices: tuple[str, ...] = ()
    refused: Mapping[str, str] = dataclasses.field(default_factory=dict)

    def admits(self, value: float) -> bool:
        """Return whether a number is in the range; NaN and infinity never are."""
        if isinstance(value, float) and not math.isfinite(value):
            return False
        if self.closed:
            return self.low <= value <= self.high
        return self.low < value < self.high

    def range_text(self) -> str:
        """Return the range in words, in SI units."""
        word = "at least" if self.closed else "above"
        under = "at most" if self.closed else "below"
        low = f"{word} {self.low:g}" if math.isfinite(self.low) else ""
        high = f"{under} {self.high:g}" if math.isfinite(self.high) else ""
        return " and ".join(part for part in (low, high) if part) or "finite"


def parameter(
    sentence: str,
    dimension: str | None = None,
    *,
    default: object = dataclasses.MISSING,
    low: float = -math.inf,
    high: float = math.inf,
    closed: bool = False,
    choices: tuple[str, ...] = (),
    refused: Mapping[str, str] | None = None,
) -> Any:
    """Return a dataclass field with a `ParameterInfo`."""
    metadata = {
        "parameter": ParameterInfo(sentence, dimension, low, high, closed, choices, refused or {})
    }
    if default is dataclasses.MISSING:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def parameter_info(field: "dataclasses.Field[T]") -> ParameterInfo | None:
    """Return the `ParameterInfo` of a field, or None for a plain field."""
    found = field.metadata.get("parameter")
    return found if isinstance(found, ParameterInfo) else None


LARGEST_NUMBER = 1e15
"""Largest accepted magnitude of a number without dimension."""
SMALLEST_NUMBER = 1e-30
"""Smallest accepted positive number; the square of a smaller one would vanish."""
LARGEST_COUNT = 2**63 - 1
"""Largest accepted magnitude of an integer."""
_KNOWN: dict[type, tuple[tuple[str, object, ParameterInfo | None], ...]] = {}
_FITTING: set[tuple[type, type]] = set()
WORDS = {str: "a text", int: "a whole number", float: "a number", bool: "true or false"}


class Validated:
    """Base class of dataclasses that check their own fields.

    A subclass defines `TABLE`, the beginning of its keys in messages, and the conditions between
    several fields in `check`.
    """

    TABLE: ClassVar[str] = ""

    def __post_init__(self) -> None:
        """Convert and check each field, then the conditions between fields."""
        validate(self, self.TABLE)
        self.check()

    def check(self) -> None:
        """Raise a `CaseError` if fields contradict each other."""


def validate(instance: object, prefix: str) -> None:
    """Convert and check the declared fields of a dataclass instance in place.

    NumPy numbers become Python numbers, arrays and lists become tuples, quantities with a unit
    become SI values.

    Parameters
    ----------
    instance : dataclass
        Frozen or not.
    prefix : str
        Beginning of the keys in messages.

    Raises
    ------
    CaseError
        A value has the wrong type or is out of range.
    """
    for name, hint, declared in _declarations(type(instance)):
        value = getattr(instance, name)
        if type(value) is hint and declared is None and hint is not float and hint is not int:
            continue  # a text, or an instance that has checked itself
        found = converted(hint, value, declared, dotted(prefix, name))
        if found is not value:
            object.__setattr__(instance, name, found)


def filled(cls: type[D], table: object, prefix: str, *, strict: bool = False, **given: object) -> D:
    """Return an instance of a dataclass from a table of its fields.

    Parameters
    ----------
    cls : type
        A dataclass.
    table : mapping
        Values by the names of the fields.
    prefix : str
        Beginning of the keys in messages.
    strict : bool
        Whether a quantity needs a unit, as in a case file; else a number is in SI units.
    given : mapping
        Values of fields that are not in the table.

    Raises
    ------
    CaseError
        It is no table, a key is unknown or missing, or a value is not admissible.
    """
    if not isinstance(table, Mapping):
        raise CaseError(prefix, f"{short(table)} is not a table", f"write [{prefix}]")
    refuse_unknown(table, [f.name for f in dataclasses.fields(cls) if f.name not in given], prefix)
    hints = {name: hint for name, hint, _ in _declarations(cls)}
    values = dict(given)
    for field in dataclasses.fields(cls):
        if field.name in given:
            continue
        key, declared = dotted(prefix, field.name), parameter_info(field)
        if field.name in table:
            hint = hints.get(field.name, object)
            values[field.name] = converted(hint, table[field.name], declared, key, strict=strict)
        elif _required(field):
            remedy = declared.sentence.lower() if declared else "it is required"
            raise CaseError(key, "missing", f"add it: {remedy}")
    return made(lambda: cls(**values), getattr(cls, "TABLE", ""), prefix)


def made(make: Callable[[], T], own: str, prefix: str) -> T:
    """Return the result of `make`; names of `own` in its errors are replaced by `prefix`."""
    try:
        return make()
    except CaseError as error:
        if own and (error.key == own or error.key.startswith((f"{own}.", f"{own}["))):
            key = prefix + error.key[len(own) :]
            raise CaseError(key, error.problem, error.remedy) from None
        raise


def converted(
    hint: object, raw: object, declared: ParameterInfo | None, key: str, *, strict: bool = False
) -> Any:
    """Return a value with the type of an annotation; see `validate` and `filled`.

    Raises
    ------
    CaseError
        The value has another type or is out of range.
    """
    if hasattr(raw, "tolist"):  # NumPy arrays and numbers, without importing NumPy
        raw = raw.tolist()
    if isinstance(hint, type) and hint in WORDS:
        return _plain(hint, raw, declared, key, strict=strict)
    origin = typing.get_origin(hint)
    if origin is types.UnionType or origin is typing.Union:
        return _one_of(typing.get_args(hint), raw, declared, key, strict=strict)
    if origin is tuple:
        return _several(typing.get_args(hint), raw, declared, key, strict=strict)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return _named(typing.get_args(hint)[1], raw, key, strict=strict)
    return _instance(hint, raw, key, strict=strict)


def _instance(hint: object, raw: object, key: str, *, strict: bool) -> object:
    """Return a path, an instance of a dataclass, or an object that implements a protocol."""
    if hint is Path:
        return path_of(raw, key)
    if not isinstance(hint, type):
        return raw
    declared = dataclasses.is_dataclass(hint)
    if not declared and not getattr(hint, "_is_protocol", False):
        return raw
    if (hint, type(raw)) in _FITTING:
        return raw
    if isinstance(raw, hint) and not isinstance(raw, type):
        _FITTING.add((hint, type(raw)))  # cached, because protocol checks are slow
        return raw
    if declared and isinstance(raw, Mapping):
        return filled(hint, raw, key, strict=strict)
    if strict:
        raise CaseError(key, f"{short(raw)} is not a table", f"write [{key}]")
    raise CaseError(key, f"{short(raw)} is of the wrong kind", f"give a {hint.__name__}")


def path_of(raw: object, key: str) -> Path:
    """Return the path of a file from a text; raise a `CaseError` if it is not valid."""
    if not isinstance(raw, str | Path) or not str(raw).strip() or "\0" in str(raw):
        raise CaseError(key, f"{short(raw)} is not the path of a file", "write one")
    return Path(raw)


def refuse_unknown(table: Mapping[str, object], known: Sequence[str], prefix: str) -> None:
    """Raise a `CaseError` for the first unknown key, with the most similar known one."""
    for key in table:
        if key not in known:
            raise CaseError(dotted(prefix, str(key)), "unknown key", nearest(str(key), known))


def dotted(prefix: str, key: str) -> str:
    """Return the full name of a key."""
    return f"{prefix}.{key}" if prefix else key


def _declarations(cls: type) -> tuple[tuple[str, object, ParameterInfo | None], ...]:
    """Return names, annotations and `ParameterInfo` of a dataclass's fields; cached per class."""
    found = _KNOWN.get(cls)
    if found is None:
        try:
            hints = typing.get_type_hints(cls)
        except NameError:  # a class of the user whose annotations can't be resolved from here
            hints = {}
        fields = [field for field in dataclasses.fields(cls) if field.init]
        found = tuple((f.name, hints.get(f.name, object), parameter_info(f)) for f in fields)
        _KNOWN[cls] = found
    return found


def _required(field: "dataclasses.Field[T]") -> bool:
    missing = dataclasses.MISSING
    return field.init and field.default is missing and field.default_factory is missing


def _plain(
    hint: type, raw: object, declared: ParameterInfo | None, key: str, *, strict: bool
) -> object:
    if hint is float or hint is int:
        return _number(hint, raw, declared, key, strict=strict)
    if not isinstance(raw, hint):
        raise CaseError(key, f"{short(raw)} is not {WORDS[hint]}", f"write {WORDS[hint]}")
    if declared is not None and declared.choices:
        return _choice(str(raw), declared, key)
    return raw


def _choice(raw: str, declared: ParameterInfo, key: str) -> str:
    if raw in declared.choices:
        return raw
    found = matching(raw, declared.choices)
    if found is None:
        remedy = "one of " + ", ".join(declared.choices)
        known = matching(raw, declared.refused)
        problem = "is not known" if known is None else declared.refused[known]
        raise CaseError(key, f"{short(raw)} {problem}", remedy)
    return found


def _number(
    hint: type, raw: object, declared: ParameterInfo | None, key: str, *, strict: bool
) -> object:
    if type(raw) is float and declared is None and hint is float and math.isfinite(raw):
        return raw
    dimension = dimension_of(declared.dimension) if declared and declared.dimension else None
    if dimension is not None and hint is float and (strict or isinstance(raw, str)):
        raw = parse_quantity(raw, dimension, key)
    kind = numbers.Real if hint is float else numbers.Integral
    if isinstance(raw, bool) or not isinstance(raw, kind):
        raise CaseError(key, f"{short(raw)} is not {WORDS[hint]}", f"write {WORDS[hint]}")
    most = LARGEST.get(dimension or "", LARGEST_NUMBER) if hint is float else LARGEST_COUNT
    try:
        value = hint(raw)
    except OverflowError:
        value = math.inf
    if not -most <= value <= most or (declared is not None and not declared.admits(value)):
        wanted = declared.range_text() if declared is not None else "finite"
        if math.isfinite(value) and (declared is None or declared.admits(value)):
            wanted = f"at most {most:g}"
        unit = " (SI units)" if dimension is not None or hint is float else ""
        raise CaseError(key, f"{_digits(value)} is out of range", f"it must be {wanted}{unit}")
    if declared is not None and declared.low == 0.0 and 0.0 < value < SMALLEST_NUMBER:
        problem = f"{_digits(value)} is out of range"
        raise CaseError(key, problem, f"it must be at least {SMALLEST_NUMBER:g} (SI units)")
    return value


def _digits(value: float) -> str:
    return str(value) if isinstance(value, int) and abs(value) < 10**15 else f"{float(value):g}"


def _one_of(
    options: Sequence[object],
    raw: object,
    declared: ParameterInfo | None,
    key: str,
    *,
    strict: bool,
) -> object:
    """Convert to the first of several types that accepts the value."""
    if raw is None and type(None) in options:
        return None
    rest = [option for option in options if option is not type(None)]
    fitting = [option for option in rest if _fits(option, raw)]
    return converted((fitting or rest)[0], raw, declared, key, strict=strict)


def _fits(option: object, raw: object) -> bool:
    if typing.get_origin(option) is tuple:
        return isinstance(raw, list | tuple)
    if isinstance(option, type) and dataclasses.is_dataclass(option):
        return isinstance(raw, option)
    return not isinstance(raw, list | tuple)


def _several(
    items: Sequence[object], raw: object, declared: ParameterInfo | None, key: str, *, strict: bool
) -> tuple[object, ...]:
    if not isinstance(raw, list | tuple):
        remedy = f'write ["{raw}"]' if items[0] is str and isinstance(raw, str) else "write [a, b]"
        raise CaseError(key, f"{short(raw)} is not a list", remedy)
    if items[-1] is not Ellipsis and len(raw) != len(items):
        raise CaseError(key, f"{len(raw)} values", f"give {len(items)}")
    nested = dataclasses.is_dataclass(items[0])
    found = tuple(
        converted(items[0], item, declared, f"{key}[{i}]" if nested else key, strict=strict)
        for i, item in enumerate(raw)
    )
    same = isinstance(raw, tuple) and all(a is b for a, b in zip(found, raw, strict=True))
    return raw if same and isinstance(raw, tuple) else found


def _named(item: object, raw: object, key: str, *, strict: bool) -> object:
    if not isinstance(raw, Mapping) or not all(isinstance(name, str) for name in raw):
        raise CaseError(key, f"{short(raw)} is not a table", f"write [{key}.NAME]")
    if item is object or item is Any:
        return raw
    return {
        name: converted(item, value, None, dotted(key, name), strict=strict)
        for name, value in raw.items()
    }


ROUND_OFF = 1e-15
"""Difference of a unit vector's length from 1."""


def unit(direction: tuple[float, ...], key: str) -> tuple[float, ...]:
    """Return a direction as a unit vector; unchanged if it has unit length up to round-off.

    Raises
    ------
    CaseError
        It has less than two components, or all are zero.
    """
    largest = max((abs(x) for x in direction), default=0.0)
    if len(direction) < 2 or not largest > 0.0:
        raise CaseError(key, f"{list(direction)}", "give a number for each axis, not all zero")
    if not 1e-100 < largest < 1e100:  # the square of a component would vanish
        direction = tuple(x / largest for x in direction)
    length = float(np.linalg.norm(direction))
    if abs(length - 1.0) <= ROUND_OFF:
        return direction
    return tuple(x / length for x in direction)
