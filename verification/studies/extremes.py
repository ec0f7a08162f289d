"""Every element under extremes: incompressibility, contrast, slivers, needles on mesh lines.

Only the columns of the needle depend on the case. Each number is an error. It must be small, or the
catalogue must state that the element is not suitable for this situation.
"""

import numpy as np

from needlefem._arrays import Floats, SkfemMesh
from needlefem.checks import (
    ISOCHORIC,
    LOCKING,
    mapped_mesh,
    over_interpolant,
    patch_error,
    solve_manufactured,
    two_material_bar,
)
from needlefem.elements import CATALOGUE, ElementType
from needlefem.errors import CaseError
from needlefem.insertion import Insertion, Simulation
from needlefem.materials import Isotropic
from needlefem.scene import BoxMesh, Refinement, Scene, vary, with_element
from needlefem.studies import Table

RATIOS = (0.3, 0.49, 0.4999, 0.499999)
CONTRASTS = (1e3, 1e6)
ASPECTS = (10.0, 100.0, 1000.0)
CONTRAST_BOUND, ASPECT_BOUND, LINE_BOUND = 1e-7, 1e-10, 1e-6
BESIDE = 1e-9
"""Distance from a mesh line, in element sizes, at which the result must be equal."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return the table of all elements."""
    del other
    rows: list[list[object]] = []
    passed = True
    for name, element in CATALOGUE.items():
        row: list[object] = [name]
        for ratio in RATIOS:
            value = _locking(element, ratio)
            made_for = ratio <= element.poissons_ratio_limit
            passed &= value <= LOCKING or not made_for
            row.append(f"{value:.1f}" + ("" if made_for else " warned"))
        for values, bound in (
            ([_contrast(element, c) for c in CONTRASTS], CONTRAST_BOUND),
            ([_aspect(element, a) for a in ASPECTS], ASPECT_BOUND),
            ([_on_a_line(scene, name, share) for share in (0.0, 0.5)], LINE_BOUND),
        ):
            passed &= max(values) <= bound
            row += [f"{value:.0e}" for value in values]
        rows.append(row)
    return [
        Table(
            title="extremes by element",
            columns=(
                "element",
                *(f"nu {ratio:g}" for ratio in RATIOS),
                *(f"contrast {c:.0e}" for c in CONTRASTS),
                *(f"1 : {a:g}" for a in ASPECTS),
                "on a line", "between",
            ),
            rows=rows,
            passed=passed,
            note=f"nu: error over the interpolant's, at most {LOCKING:g}; contrast: bar of two "
            f"materials, at most {CONTRAST_BOUND:.0e}; 1 : n: patch test on slivers, at most "
            f"{ASPECT_BOUND:.0e}; a needle along a mesh line (through vertices) or between two, "
            f"against one {BESIDE:.0e} elements beside it, at most {LINE_BOUND:.0e}",
        )
    ]  # fmt: skip


def _locking(element: ElementType, ratio: float) -> float:
    material = Isotropic(youngs_modulus=1.0, poissons_ratio=ratio)
    return over_interpolant(solve_manufactured(element, material, ISOCHORIC, 16), ISOCHORIC)


def _contrast(element: ElementType, contrast: float) -> float:
    """Return the relative error of a compressed bar with a stiffer half."""
    moved, exact = two_material_bar(element, contrast)
    return abs(moved / exact - 1.0)


def _sliver_mesh(element: ElementType, aspect: float) -> SkfemMesh:
    def flat(points: Floats) -> Floats:
        flattened: Floats = points * np.array([1.0, 1.0 / aspect])
        return flattened

    return mapped_mesh(element, (6, 6), flat)


def _aspect(element: ElementType, aspect: float) -> float:
    material = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3)
    return patch_error(_sliver_mesh(element, aspect), element, material)


def _on_a_line(scene: Scene, name: str, share: float) -> float:
    """Return how far the cut path moves, relative to the depth, when the needle hardly does.

    The mesh is regular; the needle runs at `share` of an element beside a line of vertices.
    """
    if not isinstance(scene.mesh, BoxMesh) or scene.target is None:
        raise CaseError("mesh", "the study moves the needle of a box", "give a box and a target")
    plain = with_element(vary(scene, {"mesh.refine": Refinement(), "mesh.divisions": (36, 36),
                                      "mesh.interfaces": "centroid", "mesh.pattern": "diagonal"}),
                         name)  # fmt: skip
    simulation = Simulation(plain)
    size = scene.mesh.size[0] / 36.0
    line = (round(scene.target[0] / size) + share) * size
    paths = [_pushed(simulation, line + beside, scene.target) for beside in (0.0, BESIDE * size)]
    count = min(len(path.states) for path in paths)
    moved = np.abs(paths[0].tips[:count] - paths[1].tips[:count]).max()
    forces = [np.array([state.force for state in path.states[:count]]) for path in paths]
    apart = np.abs(forces[0] - forces[1]).max() / np.abs(forces[0]).max()
    return max(float(moved) / scene.motion.max_depth, float(apart))


def _pushed(simulation: Simulation, across: float, target: tuple[float, ...]) -> Insertion:
    return simulation.insert(simulation.entry_through(np.array([across, target[1]])))
