"""A value of another kind is named, by the command and from Python."""

import pytest

import needlefem
from needlefem.errors import CaseError


def test_the_key_is_named(folder, run):
    status, _, err = run("render", ".")
    assert status == 2
    assert "'overrides' in 'run.json' is [[1, 2]], not an object" in err
    with pytest.raises(CaseError, match="'overrides' in 'run.json'"):
        needlefem.load_result(".")
