"""The laws that a case can name."""

import dataclasses
from collections.abc import Iterator, Mapping
from importlib import import_module

from needlefem import _plugin
from needlefem.errors import CaseError, matching, nearest, short

HOMES = {
    "isotropic": "isotropic:Isotropic",
    "transversely-isotropic": "anisotropic:TransverselyIsotropic",
    "orthotropic": "anisotropic:Orthotropic",
    "viscoelastic": "viscoelastic:Viscoelastic",
}


class _Laws(Mapping[str, type]):
    """The laws by their names in a case, imported when asked for."""

    def __getitem__(self, name: str) -> type:
        module, law = HOMES[name].split(":")
        found: type = getattr(import_module(f"needlefem.materials.{module}"), law)
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(HOMES)

    def __len__(self) -> int:
        return len(HOMES)


LAWS = _Laws()


def law_class(name: str, key: str) -> type:
    """Return the dataclass of a law: of the catalogue, or of the user's (``module:Class``).

    Raises
    ------
    CaseError
        There is none of that name (the nearest is named), or it is no dataclass.
    """
    if not _plugin.is_foreign(name):
        known = matching(name, LAWS)
        if known is None:
            raise CaseError(key, f"no law {short(name)}", nearest(name, LAWS))
        return LAWS[known]
    found = _plugin.load(name, key)
    if not (isinstance(found, type) and dataclasses.is_dataclass(found)):
        raise CaseError(key, f"'{name}' is no dataclass", "see docs/how-to/own-material.md")
    return found
