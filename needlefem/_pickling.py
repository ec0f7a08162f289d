"""Pickling of results without data that are computed on demand.

Factorisations can't be copied. Matrices, tables and bases are larger than a result, and can be
computed again from mesh and laws. Computed results (states, points, energies) are pickled.
"""

from functools import cached_property
from typing import Any


def lasting_state(instance: object, *others: str) -> dict[str, Any]:
    """Return the attributes of an instance for pickling and copying, without cached properties.

    Parameters
    ----------
    instance : object
    *others : str
        Further attributes that `__setstate__` computes again.
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
        """Return the state for pickling."""
        return lasting_state(self)
