"""What the factorisation costs, beside SuperLU's defaults."""

from functools import partial
from typing import Any

from scipy.sparse.linalg import splu

from needlefem.bench.timing import in_turn, median
from needlefem.casefile.load import load_case
from needlefem.elements import CATALOGUE
from needlefem.fem.build import build_model
from needlefem.fem.factor import factorise
from needlefem.resolve import resolve, with_element
from needlefem.table import Table

ROUNDS = 3


def run(case: str) -> Table:
    """Factorise the case's tissue with every element, in turn with SuperLU's defaults."""
    scene = load_case(case)
    rows: list[list[object]] = []
    for name, element in CATALOGUE.items():
        model = build_model(resolve(with_element(scene, name)).scene)
        matrix = model.stiffness.system(model.free_dofs)[0].tocsc()
        ways = {
            "ours": partial(factorise, matrix, definite=element.definite),
            "default": partial(splu, matrix),
        }
        middle = {way: 1e3 * median(times) for way, times in in_turn(ways, ROUNDS).items()}
        fills = [_fill(factor(), matrix.nnz) for factor in ways.values()]
        rows.append([name, matrix.shape[0], middle["ours"], middle["default"], *fills])
    return Table(
        title=f"{scene.title}: factorisations, medians of {ROUNDS} rounds",
        columns=("element", "unknowns", "ms", "ms, default", "fill", "fill, default"),
        rows=rows,
        note="fill: entries of both factors over those of the matrix",
    )


def _fill(factor: Any, entries: int) -> float:
    return float(factor.L.nnz + factor.U.nnz) / entries
