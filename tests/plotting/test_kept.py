"""Every kind of picture against a kept one, coarsely enough for any driver.

After a change that is meant: ``NEEDLEFEM_KEEP=1 pytest tests/plotting/test_kept.py``, and look.
"""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from needlefem import plan, render
from needlefem.alterovitz2003.figures import draw_moved_target, draw_turning
from needlefem.insertion import Insertion, Simulation
from needlefem.planning import Plan
from needlefem.plotting import (
    RenderOptions,
    draw_depth,
    draw_forces,
    draw_height,
    draw_setup,
    draw_stages,
    draw_sticking,
    html_of,
    panels,
    png_of,
)
from needlefem.plotting.figures import planner_of
from needlefem.scene import Scene, vary, with_element
from tests.insertion.test_three_dimensions import block, push, solid  # noqa: F401

KEPT = Path(__file__).parents[1] / "pictures"
SIZE = (480, 360)
BLOCK = 4
"""Pixels a side that are averaged first: drivers may smooth edges and texts as they like."""
MEAN, FAR, FEW = 2.0, 32, 0.01
"""Mean difference of colours (of 255); a difference that counts, and the share that may have it."""


def coarse(path: Path) -> np.ndarray:
    """Return a picture in blocks, shape (rows, columns, 3)."""
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB").reduce(BLOCK), dtype=float)


def alike(one: Path, other: Path) -> bool:
    """Say whether two pictures show the same."""
    a, b = coarse(one), coarse(other)
    if a.shape != b.shape:
        return False
    apart = np.abs(a - b)
    return bool(apart.mean() < MEAN and np.mean(apart.max(axis=2) > FAR) < FEW)


def check(new: Path, name: str) -> None:
    """Compare a picture with the kept one of a name, or keep it."""
    if os.environ.get("NEEDLEFEM_KEEP"):
        shutil.copy(new, KEPT / f"{name}.png")
    assert alike(new, KEPT / f"{name}.png")


def smaller(path: Path) -> None:
    """Halve a large picture: kept ones need not be large."""
    with Image.open(path) as picture:
        half = picture.convert("RGB").reduce(2).quantize(64, dither=Image.Dither.NONE)
    half.save(path, optimize=True)


def field(name: str) -> Callable[[Insertion, Path], object]:
    return lambda i, p: render(i, p, depth=0.02, shot=RenderOptions(size=SIZE, field=name))


DRAWN: dict[str, Callable[[Insertion, Path], object]] = {
    "regions": lambda i, p: render(i, p, depth=0.02, shot=RenderOptions(size=SIZE)),
    "seed": lambda i, p: render(i, p, shot=RenderOptions(size=SIZE)),
    "panels": lambda i, p: panels(i, p, count=3, shot=RenderOptions(size=SIZE)),
    "displacement": field("displacement"),
    "von-mises": field("von-mises"),
    "validity": field("validity"),
    "ultrasound": lambda i, p: render(
        i, p, depth=0.02, shot=RenderOptions(size=SIZE, texture="synthetic")
    ),
    "beside": lambda i, p: render(
        i, p, depth=0.02, beside=i, shot=RenderOptions(size=(800, 300), field="strain")
    ),
    "setup": lambda i, p: draw_setup(i.scene, p, size=SIZE),
}
LARGE: dict[str, Callable[[Insertion, Path], object]] = {
    "turning": lambda i, p: draw_turning(i, 0.02, p),
    "moved-target": lambda i, p: draw_moved_target(i, np.array([0.036, 0.025]), 0.02, p),
    "forces": draw_forces,
    "sticking": draw_sticking,
}


@pytest.mark.parametrize("name", DRAWN)
def test_pictures_are_as_kept(name: str, pushed: Insertion, tmp_path: Path) -> None:
    DRAWN[name](pushed, tmp_path / "new.png")
    check(tmp_path / "new.png", name)


@pytest.mark.parametrize("name", LARGE)
def test_figures_and_charts_are_as_kept(name: str, pushed: Insertion, tmp_path: Path) -> None:
    LARGE[name](pushed, tmp_path / "new.png")
    smaller(tmp_path / "new.png")
    check(tmp_path / "new.png", name)


_PLANNED: dict[str, Plan] = {}
PLAN: dict[str, Callable[[Scene, Plan, Path], object]] = {
    "stages": draw_stages,
    "depth": lambda s, q, p: draw_depth(planner_of(s, q), q, p),
    "height": lambda s, q, p: draw_height(planner_of(s, q), q, p),
}


@pytest.mark.parametrize("name", PLAN)
def test_pictures_of_a_plan_are_as_kept(name: str, organ: Scene, tmp_path: Path) -> None:
    scene = vary(organ, {"planning.offset_range": (-3e-3, 3e-3)})
    if "plan" not in _PLANNED:
        _PLANNED["plan"] = plan(scene)
    PLAN[name](scene, _PLANNED["plan"], tmp_path / "new.png")
    smaller(tmp_path / "new.png")
    check(tmp_path / "new.png", name)


def test_curved_edges_are_as_kept(gel: Scene, tmp_path: Path) -> None:
    scene = with_element(vary(gel, {"mesh.divisions": (5, 5)}), "P2-P1")
    simulation = Simulation(scene)  # a picture of curved cells: they are too coarse to plan on
    insertion = simulation.move(simulation.entry_of_case())
    render(insertion, tmp_path / "new.png", shot=RenderOptions(size=SIZE, field="pressure"))
    check(tmp_path / "new.png", "curved")


def test_a_block_of_tetrahedra_is_as_kept(block, gel: Scene, tmp_path: Path) -> None:  # noqa: F811
    insertion = push(block, np.array([0.0, 0.0, 1.0]), solid(gel))
    render(insertion, tmp_path / "new.png", shot=RenderOptions(size=SIZE, field="displacement"))
    check(tmp_path / "new.png", "block")
    picture = png_of(insertion)
    assert picture is not None
    assert picture.startswith(b"\x89PNG")
    assert "(x, y, z) = " in html_of(insertion)


def test_another_picture_is_not_alike(pushed: Insertion, tmp_path: Path) -> None:
    render(pushed, tmp_path / "new.png", depth=0.012, shot=RenderOptions(size=SIZE))
    assert not alike(tmp_path / "new.png", KEPT / "regions.png")


def test_a_missing_needle_is_seen(tmp_path: Path) -> None:
    """The tolerance is narrower than the smallest thing that must be there."""
    with Image.open(KEPT / "regions.png") as kept:
        picture = np.array(kept.convert("RGB"))
    needle = np.all(np.abs(picture.astype(int) - [32, 38, 46]) < 8, axis=2)
    picture[needle] = [244, 231, 197]
    Image.fromarray(picture).save(tmp_path / "new.png")
    assert not alike(tmp_path / "new.png", KEPT / "regions.png")
