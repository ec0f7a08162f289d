"""Time goes with the corners, not with their square."""

import runpy
import time
from pathlib import Path

import numpy as np

from needlefem.geometry import Contour


def disc(corners: int) -> Contour:
    turn = 2.0 * np.pi * np.arange(corners) / corners
    return Contour(0.03 + 0.01 * np.stack([np.cos(turn), np.sin(turn)], axis=1))


def test_a_case_of_5000_corners(folder: Path, run) -> None:
    runpy.run_path(str(folder / "make.py"))
    began = time.process_time()
    ended = run("run", "case.toml", "--no-pictures")
    assert ended.status in (0, 3), ended.err
    assert time.process_time() - began < 3.0


def test_cost_is_nearly_linear(folder: Path, run) -> None:
    points = np.random.default_rng(0).uniform(0.0, 0.06, (2000, 2))
    seconds = []
    for corners in (10_000, 80_000):
        contour, began = disc(corners), time.process_time()
        contour.check("regions.gland.contour")
        contour.contains(points)
        contour.distance(points)
        contour.crossings(points[:-1], points[1:])
        seconds.append(time.process_time() - began)
    assert seconds[1] < 24.0 * seconds[0]  # 8 times the corners; 64 times if quadratic
