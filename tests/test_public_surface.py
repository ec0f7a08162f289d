"""The public names: those of the package and of its folders, and no others."""

import ast
import re
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import needlefem
from tests.pages import DOCS, PAGES, ROOT, site

REFERENCE = site("reference")
FOLDERS: list[str] = REFERENCE.FOLDERS
PACKAGES = ["needlefem", *(f"needlefem.{folder}" for folder in FOLDERS)]
USERS = sorted(
    path
    for folder in ("tests", "verification", "docs", "cases")
    for path in (ROOT / folder).rglob("*.py")
    if "examples" not in path.parts
)
"""Code that uses the package as a user does."""
IMPORT = re.compile(r"^ *from (needlefem\.[\w.]+) import ([\w, ]+)$", re.MULTILINE)


def imported(package: ModuleType) -> dict[str, str]:
    """Return the modules from which ``__init__.py`` imports names, also for type checkers alone."""
    body = ast.parse(Path(package.__file__).read_text(encoding="utf-8")).body
    nodes = [node for top in body for node in (top.body if isinstance(top, ast.If) else [top])]
    return {
        alias.name: node.module
        for node in nodes
        if isinstance(node, ast.ImportFrom) and node.module.startswith("needlefem.")
        for alias in node.names
        if node.module != "needlefem._exports"
    }


def homes() -> dict[tuple[str, str], str]:
    """Return the package from which a public name of a module is to be imported."""
    return {
        (module, public): name
        for name in PACKAGES[::-1]
        for public, module in imported(import_module(name)).items()
    }


HOMES = homes()
OWN = {"__version__", "BENCHMARKS", "STUDIES"}
"""Public names that are not imported from a module."""


@pytest.mark.parametrize("name", PACKAGES)
def test_public_names_are_there_and_documented(name: str) -> None:
    package = import_module(name)
    assert len(package.__all__) == len(set(package.__all__))
    assert str(package.__doc__).count(".") >= 2, "two sentences on what the folder is for"
    for public in package.__all__:
        assert not isinstance(getattr(package, public), ModuleType), public
        assert public == "__version__" or REFERENCE.documentation(package, public), public


@pytest.mark.parametrize("name", PACKAGES)
def test_names_for_readers_type_checkers_and_the_interpreter_are_the_same(name: str) -> None:
    package = import_module(name)
    assert set(imported(package)) == set(package.__all__) - OWN
    for public, module in imported(package).items():
        assert getattr(package, public) is getattr(import_module(module), public), public


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_shows_its_public_names(name: str) -> None:
    package = import_module(name)
    assert dir(package) == sorted(package.__all__)
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        _ = package.nothing


def test_names_of_a_package_are_those_of_its_modules(monkeypatch: pytest.MonkeyPatch) -> None:
    """A name that a test replaces in its module is not kept by the folder afterwards."""
    from needlefem import fem

    true = fem.cholmod
    monkeypatch.setattr("needlefem.fem.factorization.cholmod", None)
    assert fem.cholmod is None
    monkeypatch.undo()
    assert fem.cholmod is true


@pytest.mark.parametrize("path", USERS, ids=lambda p: str(p.relative_to(ROOT)))
def test_public_names_are_imported_from_folders(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            for alias in node.names:
                home = HOMES.get((node.module, alias.name))
                assert home is None, f"from {home} import {alias.name}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_pages_import_public_names(page: Path) -> None:
    for module, names in IMPORT.findall(page.read_text(encoding="utf-8")):
        package = import_module(module)
        for name in names.split(", "):
            assert module in ("needlefem.errors", "needlefem.validation") or (
                module in PACKAGES and name in package.__all__
            ), f"from {module} import {name}"


def test_the_reference_names_every_public_name() -> None:
    pages = [DOCS / "reference" / "python.md", *(DOCS / "reference" / "python").glob("*.md")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    entries = re.findall(r"^.. (?:auto|py:)(?:class|function|data):: ([\w.]+)$", text, re.MULTILINE)
    public = {f"{name}.{each}" for name in PACKAGES for each in import_module(name).__all__} - {
        "needlefem.__version__"
    }
    assert public <= set(entries)
    assert set(entries) - public == {"needlefem.validation.parameter"}
    assert sorted(needlefem.__all__) == [
        "__version__", "build_model", "load_case", "load_result", "plan", "render", "simulate",
    ]  # fmt: skip
