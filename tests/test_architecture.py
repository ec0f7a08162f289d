"""The house stands: imports go down the floors, heavy packages are imported late."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "needlefem"
FLOORS = [
    ["_arrays", "errors", "_pickling", "_table", "_progress"],
    ["units", "_parameter", "_inputfile", "_toml"],
    ["validation"],
    ["geometry"],
    ["_plugin"],
    ["materials", "elements", "image"],
    ["mesh"],
    ["fem"],
    ["needle", "dynamics"],
    ["contact"],
    ["scene"],
    ["checks"],
    ["insertion"],
    ["planning"],
    ["studies"],
    ["io"],
    ["casefile"],
    ["newcase", "plotting"],
    ["alterovitz2003"],
    ["api"],
    ["bench", "stress"],
    ["cli"],
]
"""A module may import from its own room and from floors below."""
FLOOR = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}
FILES = sorted(PACKAGE.rglob("*.py"))


def room_of(path: Path) -> str:
    """Return the room that a file belongs to."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path) -> list[str]:
    """Return the dotted names of all modules that a file imports, wherever it does."""
    names = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names.append(node.module or "")
    return names


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_down(path: Path) -> None:
    room = room_of(path)
    if room in ("__init__", "__main__"):
        return
    for name in imports(path):
        parts = name.split(".")
        if parts[0] == "needlefem" and len(parts) > 1 and parts[1] != room:
            assert FLOOR[parts[1]] < FLOOR[room], f"{path.name} imports {name}"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_scikit_fem_is_met_in_its_rooms_only(path: Path) -> None:
    if room_of(path) not in ("mesh", "fem", "elements", "alterovitz2003"):
        assert not any(name.split(".")[0] == "skfem" for name in imports(path))


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
        "import needlefem.cli.plan\n"
        "heavy = {'pyvista', 'vtk', 'vtkmodules', 'meshio', 'matplotlib', 'rich', 'SimpleITK'}\n"
        "print(sorted(heavy & {name.split('.')[0] for name in sys.modules}))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
