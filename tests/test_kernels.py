"""Every numerical kernel has its equation, its symbols with units and its source above it."""

import re
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "needlefem"
KERNELS = {
    "contact/condensed_contact.py": ["def eliminate_lateral(", "class ShaftEquations"],
    "contact/friction.py": ["def limits(", "def solve(", "def solve_bound_qp("],
    "insertion/tip_solver.py": ["def solve("],
    "insertion/path_following.py": ["def _checked(", "def _limit_point("],
    "insertion/tip_advance.py": ["def advance_at_fixed_depth("],
    "insertion/energy_balance.py": ["def energy_terms("],
    "fem/compliance.py": ["class CachedCompliance", "class StaticCondensation"],
    "planning/error_estimate.py": ["def displacement_on("],
    "needle/needle_interface.py": ["class TipKernel"],
}


def comment_above(lines: list[str], number: int) -> str:
    """Return the comment block that ends above a line, decorators left out."""
    while lines[number - 1].lstrip().startswith("@"):
        number -= 1
    block: list[str] = []
    while lines[number - 1].lstrip().startswith("#"):
        number -= 1
        block.insert(0, lines[number].strip().removeprefix("#"))
    return "\n".join(block)


@pytest.mark.parametrize(
    ("file", "head"), [(file, head) for file, heads in KERNELS.items() for head in heads]
)
def test_a_kernel_says_what_it_solves(file: str, head: str) -> None:
    lines = (PACKAGE / file).read_text(encoding="utf-8").splitlines()
    number = next(i for i, line in enumerate(lines) if line.lstrip().startswith(head))
    comment = comment_above(lines, number)
    assert comment.startswith(" Kernel: ")
    assert re.search(r"^     \S.*(=|<=|>=|minimise)", comment, re.MULTILINE), "no equation"
    assert re.search(r", (N|m|J|N/m|m/N)\b", comment), "no units"
    assert re.search(r"^ Source: ", comment, re.MULTILINE), "no source"
