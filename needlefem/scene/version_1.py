"""Words of case files and results in schema version 1, and the words of version 2.

A case, an override and an expectation with an old word are read as if they had the new one, and
the old word is reported once. Results of version 2 keep the old keys beside the new ones for one
release, and results of version 1 are read with the new keys. ``needlefem upgrade CASE`` rewrites
a case file.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, overload

from needlefem.errors import CaseError

ANY = "*"
"""Any name of a table, or any number of an item of a list."""
KeyPath = tuple[str, ...]
"""Names of nested tables and of a key in them."""

CASE_KEYS: Mapping[KeyPath, str] = {
    ("tissue", "background"): "default_material",
    ("discretization", "kernel_points"): "tip_quadrature_points",
    ("discretization", "mass"): "mass_matrix",
    ("needle", "static_friction"): "static_friction_ratio",
    ("needle", "weakening_length"): "slip_weakening_distance",
    ("needle", "lateral_stiffness"): "lateral_penalty",
    ("needle", "stick_stiffness"): "tangential_penalty",
    ("motion", "stages", ANY, "to"): "depth",
    ("motion", "stages", ANY, "hold"): "dwell",
    ("motion", "stages", ANY, "train"): "seed_count",
    ("motion", "stages", ANY, "pitch"): "seed_spacing",
    ("planning", "height_range"): "offset_range",
    ("planning", "golden_tolerance"): "interval_tolerance",
}
"""Keys of a case file, by their old path; sections have their new name."""
CASE_VALUES: Mapping[KeyPath, Mapping[str, str]] = {
    ("discretization", "integrator"): {"march": "path_following"},
    ("mesh", "interfaces"): {"centroid": "by_centroid"},
}
"""Words that are values, by the path of their key."""

_ENERGY = {
    ("energy", "hold"): "lateral_penalty_energy",
    ("energy", "snap"): "rupture",
    ("energy", "capture"): "contact_activation",
    ("energy", "contact"): "crack_front",
    ("energy", "relaxation"): "viscoelastic",
    ("energy", "algorithmic"): "algorithmic_dissipation",
    ("energy", "identity"): "strain_energy_mismatch",
    ("energy", "turnover"): "total_absolute_work",
    ("energy", "least"): "smallest_dissipation",
    ("energy", "given"): "largest_energy_gain",
}
_EVIDENCE = _ENERGY | {
    ("discretisation",): "discretization",
    ("discretization", "kernel_points"): "tip_quadrature_points",
    ("validity", "folded_cells"): "inverted_cells",
    ("snaps",): "ruptures",
}
RESULT_KEYS: Mapping[str, Mapping[KeyPath, str]] = {
    "run": _EVIDENCE | {
        ("tip",): "tip_phase",
        ("sticking",): "sticking_segments",
        ("evaluations",): "contact_solves",
        ("seeds", ANY, "shortcut"): "elastic_prediction",
        ("seeds", ANY, "now_at"): "final_position",
        ("seeds", ANY, "from_rest"): "distance_from_rest",
        ("scanner", "seeds", ANY, "now_at"): "final_position",
    },
    "plan": _EVIDENCE | {
        ("barred",): "blocked",
        ("scanner", "barred"): "blocked",
        ("refused",): "rejected_directions",
        ("trail",): "refinement_history",
        ("search", "heights"): "lateral_offsets",
        ("search", "misses"): "lateral_errors",
    },
}  # fmt: skip
"""Keys of the results of a command, by their old path; keys above them have their new name."""
PHASES = {
    "pressing": "loading", "jumping": "rupture", "withdrawn": "retracted", "out": "outside",
}  # fmt: skip
"""Phases of the tip."""
EVENTS = {
    "snap": "rupture", "withdrawal": "retraction_start", "return": "recontact",
    "breakaway": "full_slip", "grip": "full_stick",
}  # fmt: skip
"""Kinds of events."""
STATUSES = {"restick": "stick_detected"}
"""Statuses of an insertion."""


class OldWord(NamedTuple):
    """An old word that was found.

    Parameters
    ----------
    key : str
        Its dotted key.
    old, new : str
    """

    key: str
    old: str
    new: str

    def __str__(self) -> str:
        if self.key.endswith(self.old):  # the word is the key
            return f"{self.key} is now {self.new}"
        return f"{self.key} = '{self.old}' is now '{self.new}'"


@overload
def renewed_case(
    node: dict[str, object], found: list[OldWord], path: KeyPath = ()
) -> dict[str, object]: ...


@overload
def renewed_case(node: object, found: list[OldWord], path: KeyPath = ()) -> object: ...


def renewed_case(node: object, found: list[OldWord], path: KeyPath = ()) -> object:
    """Return the tables of a case with the words of version 2.

    Parameters
    ----------
    node : mapping, list or value
        What stands at the path.
    found : list of OldWord
        The words that were replaced are appended.
    path : tuple of str

    Raises
    ------
    CaseError
        A table has a key in both versions.
    """
    if type(node) is list or type(node) is tuple:
        items = [renewed_case(item, found, (*path, str(i))) for i, item in enumerate(node)]
        return items if type(node) is list else tuple(items)
    if not isinstance(node, dict):
        return renewed_value(node, found, path)
    table: dict[str, object] = {}
    for key, value in node.items():
        name = _renamed(CASE_KEYS, (*path, str(key)), found)
        name = key if name == str(key) else name
        if name in table or (name != key and name in node):
            where = ".".join((*path, str(key)))
            raise CaseError(where, f"{name} is there as well", "keep one of the two")
        table[name] = renewed_case(value, found, (*path, str(name)))
    return table


def renewed_path(path: Sequence[str], found: list[OldWord]) -> list[str]:
    """Return the names of a dotted key of a case in the words of version 2."""
    return _all_renamed(CASE_KEYS, path, found)


def renewed_value(value: object, found: list[OldWord], path: Sequence[str]) -> object:
    """Return the value of a key in the words of version 2."""
    if not isinstance(value, str):
        return value
    if path and path[0] == "expect" and path[-1] == "key":
        return renewed_quantity(value, found)
    new = CASE_VALUES.get(tuple(path), {}).get(value)
    if new is None:
        return value
    found.append(OldWord(".".join(path), value, new))
    return new


def renewed_quantity(name: str, found: list[OldWord]) -> str:
    """Return the dotted name of a quantity of a result (``plan.snaps``) in version 2."""
    kind, *path = name.split(".")
    return ".".join((kind, *_all_renamed(RESULT_KEYS.get(kind, {}), path, found, f"{kind}.")))


def _all_renamed(
    keys: Mapping[KeyPath, str], path: Sequence[str], found: list[OldWord], above: str = ""
) -> list[str]:
    """Return a path of which every name is that of version 2."""
    names: list[str] = []
    for name in path:
        names.append(_renamed(keys, (*names, name), found, above))
    return names


def _renamed(
    keys: Mapping[KeyPath, str], path: KeyPath, found: list[OldWord], above: str = ""
) -> str:
    """Return the last name of a path in version 2; the names before it are of version 2."""
    new = keys.get(path) or keys.get(_numberless(path))
    if new is None:
        return path[-1]
    found.append(OldWord(above + ".".join(path), path[-1], new))
    return new


def _numberless(path: KeyPath) -> KeyPath:
    return tuple(ANY if part.isdigit() else part for part in path)


def report(found: Sequence[OldWord], where: str) -> str:
    """Return one line on the old words of a case."""
    shown = list(dict.fromkeys(map(str, found)))
    rest = f" and {len(shown) - 3} more" if len(shown) > 3 else ""
    return f"{where}: words of schema version 1: {'; '.join(shown[:3])}{rest}"


def with_old_keys(record: Mapping[str, object], kind: str) -> dict[str, object]:
    """Return the record of a result with the keys of version 1 beside those of version 2.

    Parameters
    ----------
    record : mapping
        In the words of version 2.
    kind : str
        ``run`` or ``plan``.
    """
    found = {"schema": 2} | _with_old_keys(record, (), RESULT_KEYS[kind])
    phases = record.get("tip_phase")
    if isinstance(phases, list):
        old = {new: word for word, new in PHASES.items()}
        found["tip"] = [old.get(phase, phase) for phase in phases]
        found["jumping"] = [phase == "rupture" for phase in phases]
    return found


def _added(node: object, path: KeyPath, keys: Mapping[KeyPath, str]) -> object:
    if isinstance(node, list | tuple):
        return [_added(item, (*path, ANY), keys) for item in node]
    return _with_old_keys(node, path, keys) if isinstance(node, Mapping) else node


def _with_old_keys(
    node: Mapping[str, object], path: KeyPath, keys: Mapping[KeyPath, str]
) -> dict[str, object]:
    table = {key: _added(value, (*path, str(key)), keys) for key, value in node.items()}
    for old, new in keys.items():
        if old[:-1] == path and new in table:
            table[old[-1]] = table[new]
    return table


def renewed_record(record: dict[str, object], kind: str) -> dict[str, object]:
    """Return the record of a result of version 1 or 2 in the words of version 2."""
    if record.get("schema") is not None or kind not in RESULT_KEYS:
        return record
    found = _with_new_keys(record, (), RESULT_KEYS[kind])
    if kind == "run":
        for key, words in (("tip_phase", PHASES), ("events", EVENTS)):
            items = found.get(key)
            if isinstance(items, list):
                found[key] = [_reworded(item, words) for item in items]
    status = found.get("status")
    if isinstance(status, str):
        found["status"] = STATUSES.get(status, status)
    return found


def _replaced(node: object, path: KeyPath, keys: Mapping[KeyPath, str]) -> object:
    if isinstance(node, list):
        return [_replaced(item, (*path, ANY), keys) for item in node]
    return _with_new_keys(node, path, keys) if isinstance(node, Mapping) else node


def _with_new_keys(
    node: Mapping[str, object], path: KeyPath, keys: Mapping[KeyPath, str]
) -> dict[str, object]:
    table = {}
    for key, value in node.items():
        name = keys.get((*path, key), key)
        table[name] = _replaced(value, (*path, name), keys)
    return table


def _reworded(item: object, words: Mapping[str, str]) -> object:
    if isinstance(item, dict) and isinstance(item.get("kind"), str):
        return item | {"kind": words.get(item["kind"], item["kind"])}
    return words.get(item, item) if isinstance(item, str) else item
