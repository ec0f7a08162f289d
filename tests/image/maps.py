"""Label maps of an analytic ellipsoid on a rotated, anisotropic grid."""

import dataclasses
from pathlib import Path

import numpy as np
import SimpleITK

CENTRE = np.array([12.0, -31.0, 74.0])
"""Of the ellipsoid, mm, LPS."""
SPACING, SIZE = np.array([0.8, 1.1, 2.5]), np.array([90, 70, 30])


def turn(axis: tuple[float, ...], angle: float) -> np.ndarray:
    """Return a rotation by an angle about an axis (Rodrigues)."""
    n = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


GRID = turn((0.3, -1.0, 0.4), 0.5)
"""Columns: directions of the voxels' indices."""
ORIGIN = CENTRE - GRID @ (0.5 * (SIZE - 1) * SPACING)
_OWN = turn((1.0, 2.0, 0.5), 0.6)


@dataclasses.dataclass(frozen=True)
class Ellipsoid:
    half_axes: tuple[float, float, float]

    @property
    def form(self) -> np.ndarray:
        """Inside: (p - CENTRE)^T form (p - CENTRE) <= 1."""
        return _OWN @ np.diag(1.0 / np.array(self.half_axes) ** 2) @ _OWN.T

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distance of points near the surface to it, mm, to first order."""
        away = points - CENTRE
        level = np.sqrt(np.einsum("ni,ij,nj->n", away, self.form, away))
        return (level - 1.0) / np.linalg.norm(away @ self.form / level[:, None], axis=1)

    def section(self, origin: np.ndarray, axes: np.ndarray, count: int) -> np.ndarray:
        """Return points of the ellipse in a plane, shape (count, 2), mm."""
        a = axes @ self.form @ axes.T
        b = axes @ self.form @ (origin - CENTRE)
        middle = -np.linalg.solve(a, b)
        rest = (origin - CENTRE) @ self.form @ (origin - CENTRE) - middle @ a @ middle
        values, vectors = np.linalg.eigh(a / (1.0 - rest))
        angle = 2.0 * np.pi * np.arange(count) / count
        circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return middle + circle / np.sqrt(values) @ vectors.T


PROSTATE, TUMOUR = Ellipsoid((22.0, 16.0, 18.0)), Ellipsoid((5.0, 4.0, 6.0))


def image(labels: np.ndarray, names: dict[str, tuple[int, int]]) -> SimpleITK.Image:
    """Return an image of labels, shape (nk, nj, ni[, nlayers]); names give value and layer."""
    made = SimpleITK.GetImageFromArray(labels, isVector=labels.ndim == 4)
    made.SetSpacing(SPACING.tolist())
    made.SetOrigin(ORIGIN.tolist())
    made.SetDirection(GRID.ravel().tolist())
    for number, (name, (value, layer)) in enumerate(names.items()):
        made.SetMetaData(f"Segment{number}_Name", name)
        made.SetMetaData(f"Segment{number}_LabelValue", str(value))
        made.SetMetaData(f"Segment{number}_Layer", str(layer))
    return made


def inside(what: Ellipsoid) -> np.ndarray:
    """Return which voxels' centres lie in an ellipsoid, shape (nk, nj, ni)."""
    k, j, i = np.meshgrid(*[np.arange(n) for n in SIZE[::-1]], indexing="ij")
    away = (np.stack([i, j, k], axis=-1) * SPACING) @ GRID.T + ORIGIN - CENTRE
    return np.einsum("...i,ij,...j", away, what.form, away) <= 1.0


def write(path: Path) -> Path:
    """Write a prostate with a tumour in its middle."""
    labels = inside(PROSTATE).astype(np.uint8)
    labels[inside(TUMOUR)] = 2
    SimpleITK.WriteImage(image(labels, {"Prostate": (1, 0), "Tumour": (2, 0)}), str(path), True)
    return path
