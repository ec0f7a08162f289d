"""How results travel between processes: as they were made, without what is computed on demand.

Factorisations can't be copied, and matrices, tables and bases are larger than a result and quick
to make again from mesh and laws. What was found with them (states, points, energies) does travel.
"""

from functools import cached_property
from typing import Any


def lasting_state(instance: object, *others: str) -> dict[str, Any]:
    """Return the attributes of an instance without its cached properties, for pickle and copy.

    Parameters
    ----------
    instance : object
    *others : str
        Further attributes that its ``__setstate__`` makes again.
    """
    cached = {
        name
        for cls in type(instance).__mro__
        for name, attribute in vars(cls).items()
        if isinstance(attribute, cached_property)
    }
    return {name: v for name, v in vars(instance).items() if name not in cached | set(others)}


class Lasting:
    """A class whose instances are pickled and copied without their cached properties."""

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled."""
        return lasting_state(self)
