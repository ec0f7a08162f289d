"""A table that is empty is named, by the command and from Python."""

import pytest

import needlefem
from needlefem.errors import CaseError


def test_the_file_is_named(folder, run):
    status, _, err = run("render", ".")
    assert status == 2
    assert "'insertion.csv' is empty" in err
    with pytest.raises(CaseError, match="'insertion.csv' is empty"):
        needlefem.load_result(".")
