"""The same mesh on cells half as large."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Floats, Points, SkfemMesh
from needlefem.geometry.contour import Contour

NEAR = 0.25
"""Distance from the contour over the length of an edge up to which its ends belong onto it."""


def uniformly_refined(mesh: SkfemMesh, contours: Sequence[Contour] = ()) -> SkfemMesh:
    """Return the mesh with every cell cut into four (eight in 3D), names kept.

    Vertices between two regions are put onto the nearest contour: the straight edges of a fitted
    mesh cut its corners.

    Parameters
    ----------
    mesh : skfem.Mesh
        With named regions that leave no cell out.
    contours : sequence of Contour
        That the mesh was fitted to.
    """
    finer = mesh.refined()
    if not contours:
        return finer
    owner = np.zeros(finer.nelements, dtype=np.intp)
    for number, cells in enumerate(finer.subdomains.values()):
        owner[cells] = number
    one, other = finer.f2t
    between = finer.facets[:, (other >= 0) & (owner[one] != owner[other])]
    ends = finer.p[:, between]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0)
    vertices, first = np.unique(between, return_index=True)
    points = finer.p.T[vertices]
    feet = _nearest(points, contours)
    near = np.linalg.norm(feet - points, axis=1) <= NEAR * np.tile(length, 2)[first]
    moved = finer.p.copy()
    moved[:, vertices[near]] = feet[near].T
    return dataclasses.replace(finer, doflocs=moved)


def _nearest(points: Points, contours: Sequence[Contour]) -> Points:
    feet = np.array([contour.project(points) for contour in contours])
    away: Floats = np.linalg.norm(feet - points, axis=2)
    found: Points = feet[np.argmin(away, axis=0), np.arange(len(points))]
    return found
