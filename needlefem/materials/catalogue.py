"""The laws that a case can name."""

import dataclasses

from needlefem import foreign
from needlefem.errors import CaseError, nearest
from needlefem.materials.anisotropic import Orthotropic, TransverselyIsotropic
from needlefem.materials.isotropic import Isotropic
from needlefem.materials.viscoelastic import Viscoelastic

LAWS: dict[str, type] = {
    "isotropic": Isotropic,
    "transversely-isotropic": TransverselyIsotropic,
    "orthotropic": Orthotropic,
    "viscoelastic": Viscoelastic,
}


def law_class(name: str, key: str) -> type:
    """Return the dataclass of a law: of the catalogue, or of the user's (``module:Class``).

    Raises
    ------
    CaseError
        There is none of that name (the nearest is named), or it is no dataclass.
    """
    if not foreign.is_foreign(name):
        if name not in LAWS:
            raise CaseError(key, f"no law '{name}'", nearest(name, LAWS))
        return LAWS[name]
    found = foreign.load(name, key)
    if not (isinstance(found, type) and dataclasses.is_dataclass(found)):
        raise CaseError(key, f"'{name}' is no dataclass", "see docs/how-to/own-material.md")
    return found
