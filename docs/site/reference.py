"""The reference of the Python interface: one page for each folder, from its ``__all__``."""

import ast
import inspect
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import needlefem

PACKAGE = Path(needlefem.__file__).parent
PRIVATE = ("alterovitz2003", "cli")
"""Folders without an interface for Python: a method to compare with, and the command line."""
FOLDERS = sorted(
    path.parent.name for path in PACKAGE.glob("*/__init__.py") if path.parent.name not in PRIVATE
)
KINDS = {"class": "Classes", "function": "Functions", "data": "Constants and types"}


def folders_table() -> str:
    """Return the folders with their first sentences, and the table of contents of their pages."""
    rows = [
        f"| [`needlefem.{folder}`](python/{folder}.md) | {_first_line(folder)} |"
        for folder in FOLDERS
    ]
    pages = [f"needlefem.{folder} <python/{folder}>" for folder in FOLDERS]
    head = ["## Folders", "", "| folder | content |", "|---|---|"]
    return "\n".join([*head, *rows, "", "```{toctree}", ":hidden:", "", *pages, "```", ""])


def folder_page(folder: str) -> str:
    """Return the page of a folder: what it is for, then its classes, functions and constants."""
    package = import_module(f"needlefem.{folder}")
    parts = [f"# `needlefem.{folder}`", "", str(package.__doc__).strip()]
    for kind, title in KINDS.items():
        names = [name for name in package.__all__ if kind_of(getattr(package, name)) == kind]
        if names:
            entries = [line for name in names for line in _entry(package, name, kind)]
            parts += ["", f"## {title}", "", "```{eval-rst}", *entries, "```"]
    return "\n".join(parts) + "\n"


def kind_of(value: Any) -> str:
    """Return ``class``, ``function`` or ``data``."""
    if isinstance(value, type) and not hasattr(value, "__origin__"):
        return "class"
    return "function" if inspect.isfunction(inspect.unwrap(value)) else "data"


def documentation(package: ModuleType, name: str) -> str:
    """Return the docstring of a public name, or the string under a constant; empty without one."""
    value = getattr(package, name)
    if kind_of(value) == "data":
        return _strings(_home(package, name)).get(name, "")
    text = inspect.unwrap(value).__doc__ or ""
    return "" if text.startswith(f"{name}(") else text  # dataclasses write their signature there


def _first_line(folder: str) -> str:
    return str(import_module(f"needlefem.{folder}").__doc__).partition("\n")[0].replace("|", "\\|")


def _entry(package: ModuleType, name: str, kind: str) -> Iterator[str]:
    full = f"{package.__name__}.{name}"
    home = ".".join(str(getattr(getattr(package, name), "__module__", "")).split(".")[:2])
    if home != package.__name__ and home.removeprefix("needlefem.") in FOLDERS and kind != "data":
        yield from (f".. py:{kind}:: {full}", "", f"   The same as ``{home}.{name}``.", "")
    elif kind == "class":
        yield from (f".. autoclass:: {full}", "   :members:")
    elif kind == "function":
        yield f".. autofunction:: {full}"
    else:
        text = inspect.cleandoc(documentation(package, name)).splitlines()
        yield from (f".. py:data:: {full}", "", *(f"   {line}".rstrip() for line in text), "")


def _home(package: ModuleType, name: str) -> Path:
    """Return the file that a public name is imported from."""
    file = Path(str(package.__file__))
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and name in [alias.name for alias in node.names]:
            return PACKAGE.parent / (str(node.module).replace(".", "/") + ".py")
    return file


@cache
def _strings(file: Path) -> dict[str, str]:
    """Return the string under each constant of a file, by its name."""
    found = {}
    for node, below in pairwise(ast.parse(file.read_text(encoding="utf-8")).body):
        if isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(below, ast.Expr):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            bound = [part for target in targets for part in ast.walk(target)]
            names = [part.id for part in bound if isinstance(part, ast.Name)]
            found |= dict.fromkeys(names, str(ast.literal_eval(below.value)))
    return found
