"""Measure which single wrong changes to the numerical core the tests detect.

A *mutant* is the package with one change: an operator, a comparison, a constant, or ``any`` for
``all``. The tests detect a mutant when at least one of them fails. The rate of detection states
how much the tests constrain the source; every mutant that survives is either equivalent to the
source or shows a test that is missing (A. P. Mathur, Foundations of Software Testing, chapter 7).

    python -m tests.mutation --count 40 --seed 7

draws one site at random in each of `count` modules drawn at random from the core (with equal
probability for each module), so that long modules do not dominate. Each mutant runs in a copy of
the repository. Tests of the mutated room run first; after the first failure the others are left
out. The tests of pictures, documentation and commands are never run: the rate is a lower bound.
"""

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
CORE = (
    "insertion",
    "contact",
    "needle",
    "fem",
    "mesh",
    "dynamics",
    "materials",
    "elements",
    "planning",
)
"""Rooms of the numerical core."""
TESTS = ("insertion", "needle", "fem", "mesh", "dynamics", "materials", "checks", "planning")
"""Rooms of tests that compute."""
COPIED = ("needlefem", "tests", "verification", "cases", "pyproject.toml", "docs")
LONGEST = 1500.0
"""Seconds after which a mutant counts as detected: its tests do not end."""
COMPARISONS = {ast.Lt: ">", ast.Gt: "<", ast.LtE: ">", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "=="}
ARITHMETIC = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
NAMES = {"any": "all", "all": "any", "max": "min", "min": "max", "maximum": "minimum",
         "minimum": "maximum", "sin": "cos", "cos": "sin"}  # fmt: skip


class Mutant(NamedTuple):
    """One change: `old` at characters `start` to `end` of a module becomes `new`."""

    path: Path
    line: int
    start: int
    end: int
    new: str

    def source(self) -> str:
        """Return the text of the module with the change."""
        text = self.path.read_text(encoding="utf-8")
        return text[: self.start] + self.new + text[self.end :]

    def __str__(self) -> str:
        """Return file, line and change."""
        text = self.path.read_text(encoding="utf-8")
        old, new = (" ".join(part.split()) for part in (text[self.start : self.end], self.new))
        return f"{self.path.relative_to(ROOT)}:{self.line}: `{old}` -> `{new}`"


def modules() -> list[Path]:
    """Return the modules of the core."""
    return [path for room in CORE for path in sorted((ROOT / "needlefem" / room).rglob("*.py"))]


def mutants(path: Path) -> list[Mutant]:
    """Return all changes of one module."""
    text = path.read_text(encoding="utf-8")
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def span(node: ast.expr) -> tuple[int, int]:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        begin = starts[node.lineno - 1] + node.col_offset
        return begin, starts[node.end_lineno - 1] + node.end_col_offset

    if not text.isascii():  # offsets of the syntax tree count bytes
        return []
    found = []
    for node in _computing(ast.parse(text)):
        found += [Mutant(path, node.lineno, *span(node), new) for new in _changes(node)]
    return found


def _changes(node: ast.expr) -> Iterator[str]:
    """Yield the wrong texts that an expression is replaced by."""
    source = ast.unparse
    match node:
        case ast.Compare(ops=[operator], comparators=[right]) if type(operator) in COMPARISONS:
            yield f"(({source(node.left)}) {COMPARISONS[type(operator)]} ({source(right)}))"
        case ast.BinOp() if type(node.op) in ARITHMETIC and not _is_text(node):
            yield f"(({source(node.left)}) {ARITHMETIC[type(node.op)]} ({source(node.right)}))"
            if isinstance(node.op, ast.Add | ast.Sub):
                yield f"({source(node.left)})"
        case ast.BoolOp():
            word = " or " if isinstance(node.op, ast.And) else " and "
            yield "(" + word.join(f"({source(value)})" for value in node.values) + ")"
        case ast.UnaryOp(op=ast.USub() | ast.Not()):
            yield f"({source(node.operand)})"
        case ast.Call(func=ast.Name(id=name)) if name in NAMES:
            yield source(node).replace(name, NAMES[name], 1)
        case ast.Call(func=ast.Attribute(value=value, attr=name)) if name in NAMES:
            new = ast.Call(ast.Attribute(value, NAMES[name]), node.args, node.keywords)
            yield source(ast.fix_missing_locations(new))
        case ast.Constant(value=float() as value) if value:
            yield repr(2.0 * value)


def _is_text(node: ast.BinOp) -> bool:
    parts = ast.walk(node)
    return any(isinstance(p, ast.JoinedStr) or _is_string(p) for p in parts)


def _is_string(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _computing(tree: ast.Module) -> Iterator[ast.expr]:
    """Yield the expressions of a module, without annotations and messages."""
    left = list[ast.AST](tree.body)
    while left:
        node = left.pop()
        if isinstance(node, ast.JoinedStr | ast.Raise | ast.Import | ast.ImportFrom):
            continue
        if isinstance(node, ast.expr):
            yield node
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list", "bases"):
                continue
            children = value if isinstance(value, list) else [value]
            left += [child for child in children if isinstance(child, ast.AST)]


def detected(mutant: Mutant, folder: Path) -> tuple[str, float]:
    """Return what detects a mutant, or an empty text, and the seconds that this took.

    Parameters
    ----------
    mutant : Mutant
    folder : Path
        A copy of the repository; it is as before afterwards.
    """
    room = mutant.path.relative_to(ROOT).parts[1]
    order = sorted(TESTS, key=lambda tests: tests != room)
    suites = [["-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", f"tests/{t}"] for t in order]
    suites.append(["-m", "needlefem", "verify", "--quick"])
    suites.append(["-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "tests/test_cases.py"])
    place = folder / mutant.path.relative_to(ROOT)
    whole, began = place.read_text(encoding="utf-8"), time.monotonic()
    environment = os.environ | {"PYTHONPATH": str(folder), "OPENBLAS_NUM_THREADS": "1"}
    try:
        place.write_text(mutant.source(), encoding="utf-8")
        for suite in suites:
            left = LONGEST - (time.monotonic() - began)
            command = [sys.executable, *suite]
            try:
                ended = subprocess.run(
                    command, cwd=folder, env=environment, capture_output=True, text=True,
                    timeout=left, check=False,
                )  # fmt: skip
            except subprocess.TimeoutExpired:
                return "no end", time.monotonic() - began
            if ended.returncode:
                lines = [x for x in ended.stdout.splitlines() if x.startswith(("FAILED", "ERROR"))]
                return (lines or [" ".join(suite[1:])])[0][:100], time.monotonic() - began
    finally:
        place.write_text(whole, encoding="utf-8")
    return "", time.monotonic() - began


def main() -> int:
    """Draw mutants, run the tests on each, print a line for each and the rate."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("--count", type=int, default=40, help="of mutants")
    parser.add_argument("--seed", type=int, default=7)
    options = parser.parse_args()
    draw = random.Random(options.seed)
    sites = {path: found for path in modules() if (found := mutants(path))}
    drawn = [draw.choice(sites[draw.choice(list(sites))]) for _ in range(options.count)]
    caught = 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for name in COPIED:
            source = ROOT / name
            if source.is_dir():
                shutil.copytree(source, folder / name)
            else:
                shutil.copy(source, folder / name)
        for number, mutant in enumerate(drawn):
            by, seconds = detected(mutant, folder)
            caught += bool(by)
            verdict = f"detected by {by}" if by else "NOT DETECTED"
            print(f"{number:3d} {mutant}: {verdict} ({seconds:.0f} s)", flush=True)
    print(f"{caught} of {len(drawn)} mutants detected (seed {options.seed})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
