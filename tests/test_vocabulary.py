"""Names and docstrings of the package: one name for one class, and the terms of the glossary."""

import ast
import io
import re
import tokenize
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "needlefem"
FORMER = {
    "account": "energy balance",
    "chronicle": "event log",
    "course": "insertion run",
    "knob": "parameter",
    "ledger": "energy balance, energy terms",
    "leg": "motion stage",
    "lying": "embedded",
    "march": "path following",
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
PRIVATE = {
    r"breakaway": "full slip",
    r"chronicles?": "event log",
    r"gives? way|gave way": "compliance, extension of a spring",
    r"knobs?": "parameter",
    r"leaps?": "rupture",
    r"ledgers?": "energy balance",
    r"lets? go": "release",
    r"march(?:e[sd])?": "path following",
    r"pieces?": "contact segment",
    r"r[ua]ns? ahead|running ahead": "advance at fixed depth",
    r"snap(?:s|ped|ping)?": "rupture",
    r"springs? off": "separate, lose contact",
    r"tells? apart|told apart": "resolve",
    r"to and fro": "forward and backward",
    r"turnover": "total absolute work",
    r"way (?:in|out|back)": "push, retraction",
}
"""Words that docstrings and comments do not use, and the terms in their place."""
QUOTED = re.compile(r"``[^`]*``|`[^`]*`|\"[^\"]*\"")
ALLOWED = {"_touch", "_moment", "wanted_size", "_wanted"}
"""Names of functions inside of one file that still have such a word."""


def definitions() -> Iterator[tuple[Path, ast.ClassDef | ast.FunctionDef]]:
    """Yield all classes and functions of the package with their files."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef | ast.FunctionDef):
                yield path, node


def prose(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line numbers and texts of docstrings and comments, without quoted words."""
    text = path.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield node.lineno, QUOTED.sub("", str(node.value.value))
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], QUOTED.sub("", token.string)


TEXTS = [(path, line, text) for path in sorted(PACKAGE.rglob("*.py")) for line, text in prose(path)]


@pytest.mark.parametrize("word", PRIVATE)
def test_docstrings_and_comments_use_terms_of_the_field(word: str) -> None:
    pattern = re.compile(rf"\b(?:{word})\b", re.IGNORECASE)
    found = [
        f"{path.relative_to(PACKAGE)}:{line}: '{match[0]}'"
        for path, line, text in TEXTS
        if (match := pattern.search(" ".join(text.split())))
    ]
    assert found == [], f"the term is: {PRIVATE[word]}"


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
