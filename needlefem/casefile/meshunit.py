"""A mesh file in another unit than the case says: found by what else the case holds."""

import numpy as np

from needlefem._arrays import Floats, SkfemMesh
from needlefem.errors import CaseError
from needlefem.mesh.generation import cell_sizes
from needlefem.scene import Scene

MESH_UNITS = {"1 um": 1e-6, "1 mm": 1e-3, "1 cm": 1e-2, "1 m": 1.0}
"""Units in which meshes are written."""
MARGIN = 0.1
"""Share of the mesh's extent by which a point may lie outside of the box around it."""
COARSEST = 4.0
"""Element size over the tip radius above which no needle is simulated; see `needle_resolution`."""


def refuse_wrong_unit(scene: Scene, mesh: SkfemMesh, unit: float) -> None:
    """Refuse a unit that nothing fits where another one lets everything fit.

    What must fit: target and entry lie in the mesh, the tip is narrower than the tissue, and the
    smallest elements can resolve the tip.

    Parameters
    ----------
    scene : Scene
    mesh : skfem.Mesh
        As read, in metres.
    unit : float, m
        With which it was read.

    Raises
    ------
    CaseError
        The scene does not fit the mesh; it does in a unit of `MESH_UNITS`, which the message names.
    """
    low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
    least = float(cell_sizes(mesh).min())
    points = [np.array(p) for p in (scene.target, scene.motion.entry or None) if p is not None]
    misfit = _misfit(scene, low, high, least, points)
    if misfit is None:
        return
    for text, other in MESH_UNITS.items():
        factor = other / unit
        if _misfit(scene, factor * low, factor * high, factor * least, points) is None:
            wide = " x ".join(f"{length:.3g}" for length in 1e3 * (high - low))
            problem = f"the mesh is {wide} mm in this unit, and {misfit}"
            raise CaseError("mesh.unit", problem, f'write unit = "{text}"')


def _misfit(
    scene: Scene, low: Floats, high: Floats, least: float, points: list[Floats]
) -> str | None:
    """Return what does not fit a mesh between two corners with elements of a least size."""
    radius, extent = scene.needle.tip_radius, high - low
    if 2.0 * radius > extent.min():
        return f"the tip is {2e3 * radius:.3g} mm wide"
    if least > COARSEST * radius:
        return f"its smallest element has {1e3 * least:.3g} mm, the tip's radius is " + (
            f"{1e3 * radius:.3g} mm"
        )
    for point in points:
        if np.any((point < low - MARGIN * extent) | (point > high + MARGIN * extent)):
            return f"({', '.join(f'{100.0 * x:.3g}' for x in point)}) cm lies outside"
    return None
