"""Estimates of work and memory of a scene, before a computation starts.

A box of 5000 x 5000 squares or a path spacing of micrometres would fill the memory or run for days.
The estimates use `BYTES_PER_UNKNOWN` and similar constants, which were measured on the cases. They
separate feasible from infeasible scenes and do not predict a run. The limits are keys of the case
(`needlefem.scene.Limits`, ``[limits]``) and can be raised.
"""

import math

from needlefem.elements import ElementType, element_row
from needlefem.errors import CaseError
from needlefem.scene.discretization import BoxMesh, Limits
from needlefem.scene.schema import Scene

BYTES_PER_UNKNOWN = 7e3
"""Memory of mesh, stiffness, factor and compliances per unknown: measured 4 to 7 kB."""
BYTES_PER_PAIR = 100.0
"""Measured memory of the dense contact matrices for each pair of contact segments."""
CELLS_PER_SQUARE = {"diagonal": 2, "crossed": 4, "quadrilateral": 1}
SPLIT = 3
"""Number of quadrilaterals made of each triangle where a box of them is refined or fitted."""
VERTICES_PER_CELL = {"triangle": 0.5, "quadrilateral": 1.0}
EDGES_PER_CELL = {"triangle": 1.5, "quadrilateral": 2.0}


def check_scene(scene: Scene) -> None:
    """Raise a `CaseError` if the needle of a resolved scene exceeds the scene's limits.

    Parameters
    ----------
    scene : Scene
        Its element is chosen.

    Raises
    ------
    CaseError
        The message contains the estimate, and the key that changes it.
    """
    limits = scene.limits
    check_mesh(scene)
    counts = {
        "discretization.tip_quadrature_points": scene.discretization.tip_quadrature_points,
        "planning.max_insertions": scene.planning.max_insertions,
    }
    if scene.targets is not None:
        counts["targets.count"] = scene.targets.count
    for number, stage in enumerate(scene.motion.stages):
        if stage.seed_count is not None:
            counts[f"motion.stages[{number}].seed_count"] = stage.seed_count
    for key, count in counts.items():
        check_count(count, key, limits, least=0)
    spacing = scene.discretization.path_spacing
    segments = math.ceil(scene.motion.max_depth / spacing)
    what = f"a path of {scene.motion.max_depth:g} m has {segments:,} segments of {spacing:g} m"
    key = "discretization.path_spacing"
    if segments > limits.steps:
        raise CaseError(key, what, _remedy("a longer spacing", "steps", f"{limits.steps:,}"))
    _check_memory(BYTES_PER_PAIR * segments**2, what, key, "a longer spacing", limits)


def check_mesh(scene: Scene) -> None:
    """Refuse a box with more cells than the scene's memory; a file's mesh when it was read."""
    mesh = scene.mesh
    if isinstance(mesh, BoxMesh):
        cells = math.prod(mesh.divisions) * CELLS_PER_SQUARE[mesh.pattern]
        check_cells(scene, cells, "mesh.divisions", "fewer divisions")


def check_cells(scene: Scene, cells: int, key: str, remedy: str) -> None:
    """Refuse a number of cells that would take more than the scene's memory.

    Parameters
    ----------
    scene : Scene
    cells : int
    key : str
        What makes them.
    remedy : str
        What makes fewer.

    Raises
    ------
    CaseError
        With the number of unknowns and the memory.
    """
    unknowns = round(cells * unknowns_per_cell(scene))
    what = f"{cells:,} cells give about {unknowns:,} unknowns"
    _check_memory(BYTES_PER_UNKNOWN * unknowns, what, key, remedy, scene.limits)


def unknowns_per_cell(scene: Scene) -> float:
    """Return the approximate number of unknowns per cell in a large mesh of the scene."""
    if scene.discretization.element == "auto":  # P2 or Q2, or a mixed one that is hardly larger
        boxed = isinstance(scene.mesh, BoxMesh) and scene.mesh.pattern == "quadrilateral"
        return unknowns_of(element_row("Q2" if boxed else "P2"), scene.dim)
    return unknowns_of(element_row(scene.discretization.element), scene.dim)


def unknowns_of(row: ElementType, dim: int) -> float:
    """Return the approximate number of unknowns of an element per cell in a large plane mesh."""
    found = dim * _dofs_per_cell(row.skfem_element(), row.cell)
    return found + (_dofs_per_cell(row.pressure(), row.cell) if row.pressure else 0.0)


def check_count(count: int, key: str, limits: Limits, *, least: int = 1) -> None:
    """Raise a `CaseError` for a number of pictures, targets, seeds or points out of range.

    Raises
    ------
    CaseError
        It is less than `least` or more than ``limits.count``.
    """
    if count < least:
        raise CaseError(key, f"{count} is out of range", f"give at least {least}")
    if count > limits.count:
        raise CaseError(key, f"{count:,} of them", _remedy("less", "count", f"{limits.count:,}"))


def check_steps(steps: float, key: str, remedy: str, limits: Limits) -> None:
    """Raise a `CaseError` if a motion needs more time steps than ``limits.steps``.

    Parameters
    ----------
    steps : float
        Number of steps of the whole motion.
    key : str
        Key of the case that determines the number.
    remedy : str
        Change that reduces the number.
    limits : Limits

    Raises
    ------
    CaseError
        The message contains the number of steps.
    """
    if steps > limits.steps:
        problem = f"the motion would take {steps:,.0f} time steps"
        raise CaseError(key, problem, _remedy(remedy, "steps", f"{limits.steps:,}"))


def _dofs_per_cell(element: "object", cell: str) -> float:
    """Return the degrees of freedom of a scalar element, shared among cells, for one cell."""
    at = (getattr(element, f"{place}_dofs", 0) for place in ("nodal", "facet", "interior"))
    nodal, facet, interior = at
    shared = nodal * VERTICES_PER_CELL.get(cell, 1.0) + facet * EDGES_PER_CELL.get(cell, 2.0)
    return float(shared + interior)


def _check_memory(needed: float, what: str, key: str, remedy: str, limits: Limits) -> None:
    if needed > limits.memory:
        problem = f"{what}, which take about {needed / 1e9:,.3g} GB of memory"
        raise CaseError(key, problem, _remedy(remedy, "memory", f"{limits.memory / 1e9:g} GB"))


def _remedy(remedy: str, limit: str, value: str) -> str:
    return f"take {remedy}, or raise limits.{limit}, now {value}"
