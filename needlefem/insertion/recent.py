"""What was made lately and may be wanted again: factorised operators, and what hangs on them."""

from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, TypeVar

Key = TypeVar("Key")
Value = TypeVar("Value")

MOST = 8
"""Operators kept: those of the motion's legs, and of some halvings of their steps."""


class LeastRecentlyUsed(Generic[Key, Value]):
    """A few values by their key; the one not asked for longest goes first."""

    def __init__(self) -> None:
        self._kept: OrderedDict[Key, Value] = OrderedDict()

    def get(self, key: Key, make: Callable[[], Value]) -> Value:
        """Return the value of a key, made if it is not there."""
        if key not in self._kept:
            self._kept[key] = make()
            if len(self._kept) > MOST:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key]
