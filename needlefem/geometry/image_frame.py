"""Position of a case's plane in the coordinate system of the scanner."""

import dataclasses
from functools import cached_property

import numpy as np

from needlefem._arrays import Floats, Points
from needlefem.errors import CaseError
from needlefem.validation import Validated, parameter

Coordinates = tuple[float, ...]
SQUARE = 1e-6
"""Tolerance for the lengths of unit vectors and for right angles."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Voxels(Validated):
    """The grid of an image in the scanner's space.

    The centre of voxel (i, j, k) is at ``origin + i spacing_i axes_i + j ... + k ...``.
    """

    TABLE = "frame.voxels"

    file: str = parameter("Name of the image's file", default="")
    origin: Coordinates = parameter("Centre of the first voxel, in the scanner's space", "length")
    axes: tuple[Coordinates, ...] = parameter("Directions in which the voxels' three numbers grow")
    spacing: Coordinates = parameter("Distances of the voxels' centres", "length", low=0.0)
    size: tuple[int, ...] = parameter("Numbers of voxels", low=1.0, closed=True)

    def check(self) -> None:
        """See `Validated`."""
        _check_vectors("frame.voxels.axes", self.axes, 3)
        for name in ("origin", "spacing", "size"):
            _check_length(f"frame.voxels.{name}", getattr(self, name))

    @cached_property
    def _steps(self) -> Floats:
        """Rows: from a voxel to the next along every index, shape (3, 3), m."""
        steps: Floats = np.array(self.axes) * np.array(self.spacing)[:, None]
        return steps

    def points(self, numbers: Points) -> Points:
        """Return scanner coordinates of (fractions of) voxel numbers, shape (n, 3), m."""
        found: Points = np.asarray(numbers) @ self._steps + np.array(self.origin)
        return found

    def numbers(self, points: Points) -> Points:
        """Return the (fractions of) voxel numbers of scanner coordinates, shape (n, 3)."""
        away = np.asarray(points) - np.array(self.origin)
        found: Points = np.linalg.solve(self._steps.T, away.T).T
        return found


@dataclasses.dataclass(frozen=True, kw_only=True)
class ImageFrame(Validated):
    """The plane of a case in the scanner's space, and the image from which it was taken."""

    TABLE = "frame"

    space: str = parameter(
        "Axes of the scanner's space: left, posterior, superior (DICOM) or right, anterior, "
        "superior (3D Slicer)",
        default="LPS",
        choices=("LPS", "RAS"),
    )
    origin: Coordinates = parameter("The case's point (0, 0) in the scanner's space", "length")
    axes: tuple[Coordinates, ...] = parameter(
        "The case's axes as unit vectors in the scanner's space"
    )
    voxels: Voxels | None = None

    def check(self) -> None:
        """See `Validated`."""
        _check_length("frame.origin", self.origin)
        _check_vectors("frame.axes", self.axes, 2)

    def to_scanner(self, points: Points) -> Points:
        """Return scanner coordinates of points of the case, shape (..., 2) to (..., 3), m."""
        found: Points = np.array(self.origin) + self.turned(points)
        return found

    def turned(self, vectors: Points) -> Points:
        """Return directions of the case in the scanner's space, shape (..., 2) to (..., 3)."""
        found: Points = np.asarray(vectors, dtype=float) @ np.array(self.axes)
        return found

    def from_scanner(self, points: Points) -> Points:
        """Return projections of scanner points on the plane, shape (..., 3) to (..., 2), m."""
        found: Points = (np.asarray(points, dtype=float) - np.array(self.origin)) @ self._axes.T
        return found

    def off_plane(self, points: Points) -> Floats:
        """Return the signed distances of scanner coordinates to the plane, shape (...,), m."""
        away = np.asarray(points, dtype=float) - np.array(self.origin)
        found: Floats = away @ np.cross(*self._axes)
        return found

    @cached_property
    def _axes(self) -> Floats:
        return np.array(self.axes)


def _check_length(key: str, values: Coordinates) -> None:
    if len(values) != 3:
        raise CaseError(key, f"{len(values)} numbers", "give 3: the scanner's space has three axes")


def _check_vectors(key: str, vectors: tuple[Coordinates, ...], count: int) -> None:
    if len(vectors) != count or any(len(vector) != 3 for vector in vectors):
        raise CaseError(key, f"{list(vectors)}", f"give {count} vectors of 3 numbers")
    angles = np.array(vectors) @ np.array(vectors).T
    if not np.allclose(angles, np.eye(count), atol=SQUARE, rtol=0.0):
        remedy = f"give {count} unit vectors at right angles"
        raise CaseError(key, f"{[list(vector) for vector in vectors]}", remedy)
