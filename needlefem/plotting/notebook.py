"""HTML tables and pictures of scenes, insertions, plans and saved results in notebooks."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import singledispatch
from html import escape
from pathlib import Path

import numpy as np

from needlefem._arrays import Vector
from needlefem.errors import NoRendererError
from needlefem.insertion.result import Insertion
from needlefem.io.saved_result import SavedResult
from needlefem.planning.result import Plan, headline
from needlefem.plotting.images import force_unit
from needlefem.scene import Scene

SIZE = (800, 600)
"""Size of a picture in a notebook, pixels."""


@singledispatch
def html_of(result: object) -> str:
    """Return a table of the most important numbers of a result as HTML."""
    raise TypeError(f"{type(result).__name__} has no table")


@html_of.register
def _(result: Insertion) -> str:
    last, outcome, axes = result.states[-1], result.outcome, result.model.axes
    rows = {
        "status": f"{outcome.status}: {outcome.sentence}",
        "depth": f"{100 * last.depth:.3f} cm",
        "material at the tip": _place(last.tip, axes),
        "force at the end": f"{last.force:.4g} {force_unit(result.model.dim)}",
        "seeds": ", ".join(f"{s.name} {_place(s.point, axes)}" for s in result.seeds),
        "mesh": f"{result.model.mesh.nelements} cells, {result.scene.discretization.element}",
    }
    return _table(result.scene.title, rows)


@html_of.register
def _(result: Plan) -> str:
    scene, best, axes = result.insertion.scene, result.best, result.insertion.model.axes
    rows = {
        "status": f"{result.status}: {result.sentence}",
        "target": _place(result.target, axes),
        "release at": "" if best is None else _place(best.release_point, axes),
        "release depth": _centimetres(_release_depth(result)),
        "final position": "" if best is None else _place(best.placed_at, axes),
        "placement error": "" if best is None else headline(result).error,
        "insertions": f"{result.insertions} ({result.search})",
        "residual of the search": "" if best is None else f"{100 * best.placement_error:.2g} cm",
        "warnings": "" if result.evidence is None else "; ".join(result.evidence.warnings),
    }
    if scene.frame is not None and best is not None:
        point = scene.frame.to_scanner(best.release_point)
        place = ", ".join(f"{1e3 * x:.2f}" for x in point)
        rows["release in the scanner"] = f"({place}) mm, {scene.frame.space}"
    return _table(scene.title, rows)


@html_of.register
def _(result: Scene) -> str:
    materials = {name: region.material for name, region in result.regions.items()}
    needle = result.needle
    force = f"{needle.cutting_force:.4g} {force_unit(result.dim)}"
    rows = {
        "tissue": ", ".join(
            [result.default_material, *(f"{n}: {m}" for n, m in materials.items())]
        ),
        "supports": ", ".join(result.supports),
        "element": f"{result.discretization.element}, {result.discretization.integrator}",
        "needle": f"tip {1e3 * needle.tip_radius:.3g} mm, cuts at {force}",
        "deepest": f"{100 * result.motion.max_depth:.3f} cm",
        "target": "" if result.target is None else _place(result.target, result.axes),
        "case": "" if result.source is None else str(result.source),
    }
    return _table(result.title, rows)


@html_of.register
def _(result: SavedResult) -> str:
    keys = ("status", "sentence", "source")
    rows = {key: str(result.record[key]) for key in keys if result.record.get(key) is not None}
    rows |= {"tables": ", ".join(result.tables), "snapshots": str(len(result.snapshots) or "")}
    return _table(f"{result.kind}: {result.path}", rows)


def _centimetres(length: float | None) -> str:
    return "" if length is None else f"{100 * length:.3f} cm"


def _place(point: Vector | Sequence[float], axes: Sequence[str]) -> str:
    values = ", ".join(f"{100 * x:.3f}" for x in point)
    return f"({', '.join(axes)}) = ({values}) cm"


def _table(title: str, rows: Mapping[str, str]) -> str:
    cells = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th>"
        f"<td style='text-align:left'>{escape(value)}</td></tr>"
        for name, value in rows.items()
        if value
    )
    return f"<table><caption>{escape(title)}</caption>{cells}</table>"


def png_of(result: object) -> bytes | None:
    """Return a picture as PNG: a scene before the simulation, an insertion, or a plan.

    The needle is shown at its last depth, in a plan at the release. The result is None if no
    renderer is available or there is no insertion to show: a notebook then shows the table.
    """
    from needlefem.plotting.figures import draw_setup  # noqa: PLC0415
    from needlefem.plotting.render import RenderOptions, render  # noqa: PLC0415

    if isinstance(result, Scene):
        return _drawn(lambda path: draw_setup(result, path, size=SIZE))
    insertion = result.insertion if isinstance(result, Plan) else result
    if not isinstance(insertion, Insertion) or len(insertion.states) < 2:
        return None
    depth = _release_depth(result) if isinstance(result, Plan) else None
    return _drawn(lambda path: render(insertion, path, depth=depth, shot=RenderOptions(size=SIZE)))


def _drawn(draw: Callable[[Path], Path]) -> bytes | None:
    try:
        with tempfile.TemporaryDirectory() as folder:
            return draw(Path(folder) / "shown.png").read_bytes()
    except NoRendererError:
        return None


def _release_depth(plan: Plan) -> float | None:
    if plan.best is None:
        return None
    depth = float(plan.insertion.axis.axial_coordinate(plan.best.release_point))
    return min(depth, float(np.max(plan.insertion.depths)))
