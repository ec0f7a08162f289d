"""Names in the package: one name for one class, and the terms of the glossary."""

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "needlefem"
FORMER = {
    "account": "energy balance",
    "chronicle": "event log",
    "course": "insertion run",
    "knob": "parameter",
    "ledger": "energy balance, energy terms",
    "leg": "motion stage",
    "lying": "embedded",
    "path_following": "path following",
    "medium": "tissue response",
    "moment": "tip trial, frame",
    "rubbing": "friction",
    "settle": "solve, converge",
    "snap": "rupture",
    "tick": "time step",
    "touch": "skin contact",
    "wanted": "request, requested",
}
"""Words that names had which no paper uses, and the terms in their place."""
ALLOWED = {"_touch", "_moment", "wanted_size", "_wanted"}
"""Names of functions inside of one file that still have such a word."""


def definitions() -> Iterator[tuple[Path, ast.ClassDef | ast.FunctionDef]]:
    """Yield all classes and functions of the package with their files."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef | ast.FunctionDef):
                yield path, node


def test_a_class_name_stands_for_one_class() -> None:
    places = defaultdict(list)
    for path, node in definitions():
        if isinstance(node, ast.ClassDef):
            places[node.name].append(str(path.relative_to(PACKAGE)))
    assert {name: files for name, files in places.items() if len(files) > 1} == {}


def test_names_are_terms_of_the_field() -> None:
    former = []
    for path, node in definitions():
        words = {word.lower() for word in re.findall(r"[A-Z]?[a-z]+", node.name)}
        if node.name not in ALLOWED and words & FORMER.keys():
            former.append(f"{path.relative_to(PACKAGE)}: {node.name}")
    assert former == []
