"""Insertions that many pictures show."""

import pytest

from needlefem import simulate
from needlefem.insertion import Insertion
from needlefem.scene import Scene, Stage, vary

_KNOWN: dict[str, Insertion] = {}


@pytest.fixture
def pushed(organ: Scene) -> Insertion:
    """Return one insertion into the organ, with a seed and a way back."""
    stages = (Stage(depth=0.025, release="seed"), Stage(depth=-0.002))
    if "pushed" not in _KNOWN:
        _KNOWN["pushed"] = simulate(vary(organ, {"motion.stages": stages}))
    return _KNOWN["pushed"]
