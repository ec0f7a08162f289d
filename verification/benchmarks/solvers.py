"""Cost of the factorisation with each solver, relative to the defaults of SuperLU."""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.sparse.linalg import splu

from needlefem import build_model, load_case
from needlefem._arrays import Floats, Sparse
from needlefem.bench import median, processor_seconds
from needlefem.elements import CATALOGUE
from needlefem.fem import CholmodFactor, SuperLUFactor, cholmod
from needlefem.fem.compliance import BLOCK
from needlefem.plotting import Bar, bars
from needlefem.scene import resolve, with_element
from needlefem.studies import Table

ROUNDS = 3


class Default:
    """SuperLU as scipy calls it."""

    name = "SuperLU, default"

    def __init__(self, matrix: Sparse) -> None:
        self._factor = splu(matrix)
        self.solve = self._factor.solve

    @property
    def entries(self) -> int:
        """Number of entries of both factors."""
        return int(self._factor.L.nnz + self._factor.U.nnz)


Way = Callable[[Sparse], Default | SuperLUFactor | CholmodFactor]


@dataclasses.dataclass(frozen=True)
class _Costs:
    """Seconds to factorise, for one right-hand side, for each of a block; and the fill."""

    factor: float
    single: float
    block: float
    fill: float


def run(case: str) -> Table:
    """Factorise the case's tissue with each element and each solver."""
    scene = load_case(case)
    rows: list[list[Any]] = []
    for name, element in CATALOGUE.items():
        model = build_model(resolve(with_element(scene, name)).scene)
        matrix = model.stiffness.system(model.free_dofs)[0].tocsc()
        ways: list[Way] = [partial(SuperLUFactor, definite=element.definite), Default]
        if element.definite and cholmod() is not None:
            ways.insert(1, CholmodFactor)
        for way in ways:
            solver, found = _costs(way, matrix)
            times = (1e3 * found.factor, 1e3 * found.single, 1e3 * found.block)
            rows.append([name, matrix.shape[0], solver, *times, found.fill])
    solvers = list(dict.fromkeys(row[2] for row in rows))
    missing = "" if cholmod() is not None else "; CHOLMOD is not installed here"
    return Table(
        title=f"{scene.title}: factorisations, medians of {ROUNDS} rounds",
        columns=("element", "unknowns", "solver", "factor (ms)", "one rhs (ms)",
                 f"each of {BLOCK} (ms)", "fill"),
        rows=rows,
        charts={
            scene.title: bars("factorisations", "milliseconds", [
                Bar(f"{row[0]}, {row[2]}", row[3], series=solvers.index(row[2])) for row in rows
            ])
        },
        note=f"fill: entries of both factors over those of the matrix{missing}",
    )  # fmt: skip


def _costs(way: Way, matrix: Sparse) -> tuple[str, _Costs]:
    factor = way(matrix)
    one: Floats = np.ones(matrix.shape[0])
    many = np.ones((matrix.shape[0], BLOCK), order="F")
    return factor.name, _Costs(
        factor=median(processor_seconds(lambda: way(matrix), ROUNDS)),
        single=median(processor_seconds(lambda: factor.solve(one), ROUNDS)),
        block=median(processor_seconds(lambda: factor.solve(many), ROUNDS)) / BLOCK,
        fill=factor.entries / matrix.nnz,
    )
