"""Meshes: made, read from files, refined, fitted to contours, checked.

A mesh is one of scikit-fem, with named groups of cells and of boundary facets. Points can be
located in it, and its surface gives where a needle enters.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.mesh.cell_map import (
        AffineMap,
        BilinearMap,
        CellMap,
        Locator,
        cell_measures,
        corner_jacobians,
    )
    from needlefem.mesh.conform import fit_to_contour, fit_to_contours, uniformly_refined
    from needlefem.mesh.file import PlaneMesh, UnreadableMeshError, read_mesh, read_plane_mesh
    from needlefem.mesh.generation import (
        BACKGROUND,
        box,
        cell_sizes,
        curved,
        group_cells,
        into_quadrilaterals,
        name_faces,
        name_regions,
        near_segment,
        outline,
        parts,
        refine,
        signed_measures,
    )
    from needlefem.mesh.soundness import refuse_unsound
    from needlefem.mesh.surface import Entry, Surface, TipWatch, check_entry, entry_along, entry_at

__all__ = [
    "BACKGROUND",
    "AffineMap",
    "BilinearMap",
    "CellMap",
    "Entry",
    "Locator",
    "PlaneMesh",
    "Surface",
    "TipWatch",
    "UnreadableMeshError",
    "box",
    "cell_measures",
    "cell_sizes",
    "check_entry",
    "corner_jacobians",
    "curved",
    "entry_along",
    "entry_at",
    "fit_to_contour",
    "fit_to_contours",
    "group_cells",
    "into_quadrilaterals",
    "name_faces",
    "name_regions",
    "near_segment",
    "outline",
    "parts",
    "read_mesh",
    "read_plane_mesh",
    "refine",
    "refuse_unsound",
    "signed_measures",
    "uniformly_refined",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        cell_map="AffineMap BilinearMap CellMap Locator cell_measures corner_jacobians",
        conform="fit_to_contour fit_to_contours uniformly_refined",
        file="PlaneMesh UnreadableMeshError read_mesh read_plane_mesh",
        generation=(
            "BACKGROUND box cell_sizes curved group_cells into_quadrilaterals name_faces "
            "name_regions near_segment outline parts refine signed_measures"
        ),
        soundness="refuse_unsound",
        surface="Entry Surface TipWatch check_entry entry_along entry_at",
    )
