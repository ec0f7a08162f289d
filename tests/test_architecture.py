"""What import-linter (`make lint`) does not see: imports by name, late imports, sizes."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "needlefem"
FILES = sorted(PACKAGE.rglob("*.py"))


LOADERS = {
    "_exports.py",  # public names, imported when first used
    "_plugin.py",  # code of the user
    "cli/main.py",  # the command that is asked for, alone
    "cli/experiments.py",  # the study or the benchmark that is asked for
    "materials/catalogue.py",  # laws that few cases name
}
"""Modules that import others by name; the contracts of import-linter do not see these imports."""


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_modules_are_not_imported_by_name(path: Path) -> None:
    if str(path.relative_to(PACKAGE)) in LOADERS:
        return
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in (
            "import_module",
            "__import__",
        ):
            assert isinstance(node.args[0], ast.Constant), path
            assert not str(node.args[0].value).startswith("needlefem"), path


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_modules_are_not_full(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 500


def test_import_is_light() -> None:
    code = (
        "import sys, needlefem\n"
        "heavy = {'pyvista', 'vtk', 'vtkmodules', 'meshio', 'matplotlib', 'numpy', 'skfem',\n"
        "         'SimpleITK'}\n"
        "print(sorted(heavy & {name.split('.')[0] for name in sys.modules}))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_planning_imports_no_pictures() -> None:
    code = (
        "import sys, needlefem\n"
        "needlefem.plan, needlefem.load_case, needlefem.simulate\n"
        "import needlefem.cli.main, needlefem.cli.plan\n"
        "heavy = {'pyvista', 'vtk', 'vtkmodules', 'meshio', 'matplotlib', 'rich', 'SimpleITK'}\n"
        "rooms = {'needlefem.plotting', 'needlefem.image', 'needlefem.newcase.box',\n"
        "         'scipy.optimize', 'scipy.ndimage', 'needlefem.dynamics',\n"
        "         'needlefem.contact.friction', 'needlefem.io.saved_result'}\n"
        "found = {name.split('.')[0] for name in sys.modules} | set(sys.modules)\n"
        "print(sorted((heavy | rooms) & found))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


MOST_ANY = 60
"""Number of lines with the type `Any` in the package from which on this is too many."""


def quoted_types(tree: ast.AST) -> list[ast.Constant]:
    """Return the texts in annotations and type aliases."""
    homes: list[ast.AST | None] = []
    for node in ast.walk(tree):
        homes += [getattr(node, "annotation", None), getattr(node, "returns", None)]
        if isinstance(node, ast.AnnAssign) and "TypeAlias" in ast.unparse(node.annotation):
            homes.append(node.value)
    return [
        part
        for home in homes
        if home is not None
        for part in ast.walk(home)
        if isinstance(part, ast.Constant) and isinstance(part.value, str)
    ]


def lines_with_any(source: str) -> set[int]:
    """Return the lines where a type is `Any`: annotations, aliases, casts; imports do not count."""
    tree = ast.parse(source)
    found = {part.lineno for part in quoted_types(tree) if re.search(r"\bAny\b", str(part.value))}
    for node in ast.walk(tree):
        name = node.id if isinstance(node, ast.Name) else getattr(node, "attr", None)
        if name == "Any":
            found.add(node.lineno)
    return found


def test_lines_with_any_are_found() -> None:
    source = (
        "import typing\n"
        "from typing import Any, TypeAlias\n"
        "Table = dict[str, Any]\n"
        'Tree: TypeAlias = "list[Tree] | Any"\n'
        "def f(a: typing.Any, *b: 'list[Any]') -> int:\n"
        '    c: "Any" = a\n'
        '    """Any text."""\n'
        "    return len('Any')\n"
    )
    assert lines_with_any(source) == {3, 4, 5, 6}


def test_few_types_are_any() -> None:
    found = [
        f"{path.relative_to(PACKAGE)}:{line}"
        for path in FILES
        for line in sorted(lines_with_any(path.read_text(encoding="utf-8")))
    ]
    assert len(found) < MOST_ANY, found


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_no_name_stands_for_any(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Assign | ast.AnnAssign):
            assert not (isinstance(node.value, ast.Name) and node.value.id == "Any"), node.lineno
