from pathlib import Path

import pytest

from needlefem import _plugin
from needlefem.dynamics import integrator_class
from needlefem.elements import element_row
from needlefem.errors import CaseError
from needlefem.materials import law_class


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stand in a folder with a module, code not allowed yet."""
    (tmp_path / "mine_of_test.py").write_text(
        "VALUE = 3\n\n\nclass WithoutStepper:\n    pass\n\n\ndef stepper_of(_):\n    return 1\n\n\n"
        "stepper_of.stepper = stepper_of\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(_plugin, "_allowed", False)


@pytest.mark.usefixtures("mine")
def test_code_is_not_run_unasked() -> None:
    with pytest.raises(CaseError, match="is code, which is not run unasked; pass --allow-code"):
        _plugin.load("mine_of_test:VALUE", "key")


@pytest.mark.usefixtures("mine")
def test_code_is_found_once_allowed() -> None:
    _plugin.allow()
    assert _plugin.load("mine_of_test:VALUE", "key") == 3
    with pytest.raises(CaseError, match="key: no 'OTHER' in 'mine_of_test'"):
        _plugin.load("mine_of_test:OTHER", "key")
    with pytest.raises(CaseError, match="No module named 'nowhere_at_all'"):
        _plugin.load("nowhere_at_all:X", "key")


@pytest.mark.usefixtures("mine")
def test_what_is_named_must_be_what_it_is_used_as() -> None:
    _plugin.allow()
    with pytest.raises(CaseError, match="is not a dataclass"):
        law_class("mine_of_test:VALUE", "materials.x.law")
    with pytest.raises(CaseError, match="is not an ElementType"):
        element_row("mine_of_test:VALUE")
    for name in ("VALUE", "WithoutStepper", "stepper_of"):
        with pytest.raises(CaseError, match="has no method stepper"):
            integrator_class(f"mine_of_test:{name}", "discretization.integrator")
