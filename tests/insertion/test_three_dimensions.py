"""Three dimensions are a mesh and an element: nothing of the needle knows how many there are."""

import numpy as np
import pytest
import skfem

from needlefem.checks import EmbeddedShaft, preflight
from needlefem.elements import ElementType, simplex
from needlefem.fem import CachedCompliance, TissueModel
from needlefem.insertion import Insertion, PathFollowing, Status, displacements, energy_terms
from needlefem.materials import Isotropic
from needlefem.mesh import BACKGROUND
from needlefem.needle import InsertionAxis, NeedleInterface, TipKernel, cross_section
from needlefem.scene import Scene, Support, vary

TETRAHEDRON = ElementType(
    name="T1",
    cell="tetrahedron",
    skfem_element=skfem.ElementTetP1,
    degree=1,
    stiffness_rule=simplex(1, 3),
    mass_rule=simplex(2, 3),
    lumpings=("row-sum",),
    poissons_ratio_limit=0.45,
)


@pytest.fixture
def block() -> TissueModel:
    coordinates = np.linspace(0.0, 0.04, 9)
    return of_two_tissues(skfem.MeshTet.init_tensor(coordinates, coordinates, coordinates))


@pytest.fixture
def mirrored() -> TissueModel:
    """Return a block that is its own mirror image in the plane y = 2 cm."""
    coordinates = np.linspace(0.0, 0.04, 7)
    half = skfem.MeshTet.init_tensor(coordinates, coordinates[:4], coordinates)
    return of_two_tissues(half + half.mirrored((0.0, 1.0, 0.0), (0.0, 0.02, 0.0)))


def of_two_tissues(mesh: skfem.MeshTet) -> TissueModel:
    middles = mesh.p[:, mesh.t].mean(axis=1)
    stiff = (middles[0] > 0.024) & (middles[2] > 0.01)
    mesh = mesh.with_subdomains(
        {BACKGROUND: np.flatnonzero(~stiff), "stiff": np.flatnonzero(stiff)}
    )
    mesh = mesh.with_boundaries({"far": lambda x: x[2] > 0.04 - 1e-9})
    materials = {
        BACKGROUND: Isotropic(youngs_modulus=20e3, poissons_ratio=0.4),
        "stiff": Isotropic(youngs_modulus=80e3, poissons_ratio=0.4),
    }
    return TissueModel(
        mesh, TETRAHEDRON, materials, {"far": Support(faces=("far",))}, ("x", "y", "z")
    )


def solid(gel: Scene) -> Scene:
    """Return the gel as a cube with a target in it."""
    return vary(
        gel,
        {
            "axes": ("x", "y", "z"),
            "mesh": {"size": (0.04,) * 3, "divisions": (8,) * 3},
            "motion.direction": (0.0, 0.0, 1.0),
            "target": (0.02, 0.02, 0.02),
        },
    )


def push(
    model: TissueModel, direction: np.ndarray, scene: Scene, across: float = 0.0192
) -> Insertion:
    entry, inward = np.array([0.0205, across, 0.0]), np.array([0.0, 0.0, 1.0])
    instrument = NeedleInterface(
        axis=InsertionAxis(entry, direction / np.linalg.norm(direction)),
        kernel=TipKernel(3e-3, 200, entry, inward),
        interpolation=model.interpolation,
        cutting_force=np.full(model.nnodes, 0.2),
        shaft_friction=np.full(model.nnodes, 10.0),
        section=cross_section(3e-3, 60, 3),
        lateral_penalty=1e6,
        spacing=2e-3,
        inward=inward,
    )
    path_following = PathFollowing(instrument, CachedCompliance(model), 0.025)
    assert len(list(path_following.iterate())) > 8
    return path_following.result(scene, model)


@pytest.mark.parametrize("direction", [[0.0, 0.0, 1.0], [0.1, -0.2, 1.0]])
def test_march_in_a_block_of_tetrahedra(
    block: TissueModel, gel: Scene, direction: list[float]
) -> None:
    insertion = push(block, np.array(direction), gel)
    assert insertion.outcome.status is Status.COMPLETED
    last = insertion.states[-1]
    length = np.linalg.norm(np.diff(insertion.tips, axis=0), axis=1).sum()
    assert last.force == pytest.approx(0.2 + 10.0 * length)
    assert last.lateral_force.shape == (len(insertion.segments), 2)
    energies = energy_terms(insertion)
    assert energies.strain_energy_mismatch < 1e-12
    assert energies.residual < 1e-12


def test_the_tip_is_on_the_axis_in_both_lateral_directions(
    mirrored: TissueModel, gel: Scene
) -> None:
    """In a plane of symmetry one of them is met from the first; the other must be solved for."""
    insertion = push(mirrored, np.array([0.3, 0.0, 1.0]), gel, across=0.02)
    assert insertion.outcome.status is Status.COMPLETED
    axis, numbers = insertion.axis, range(1, len(insertion.states))
    moved = displacements(insertion, numbers)
    apart = []
    for number, state in enumerate(insertion.states[1:]):
        field = mirrored.nodal(moved[:, number])
        where = state.tip + state.tip_weights @ field[state.tip_nodes]
        apart.append(axis.lateral_offset(where))
        assert axis.axial_coordinate(where) == pytest.approx(state.depth, abs=1e-11)
    assert np.abs(apart).max() < 5e-12
    lean = np.abs(axis.lateral_offset(insertion.tips)).max(axis=0)
    assert max(lean) > 1e-5  # the tissue yields sideways ...
    assert min(lean) < 1e-12  # ... within the plane of symmetry


def test_checks_hold_in_three_dimensions(block: TissueModel) -> None:
    assert [check.name for check in preflight(block) if not check.passed] == []


def slab(radius: float, thickness: float, divisions: int) -> TissueModel:
    """Return a disc of one layer of cells that moves along its axis alone, held at its rim."""
    coordinates = np.linspace(-1.0, 1.0, 2 * divisions + 1)
    mesh = skfem.MeshTet.init_tensor(coordinates, coordinates, np.array([0.0, thickness]))
    x, y, z = mesh.p
    grade = np.maximum(np.abs(x), np.abs(y)) ** 0.5  # finer towards the needle
    round_x, round_y = x * np.sqrt(1.0 - 0.5 * y**2), y * np.sqrt(1.0 - 0.5 * x**2)
    points = np.stack([radius * grade * round_x, radius * grade * round_y, z])
    mesh = skfem.MeshTet(points, mesh.t)
    mesh = mesh.with_subdomains({BACKGROUND: np.arange(mesh.nelements)}).with_boundaries(
        {
            "rim": lambda p: np.hypot(p[0], p[1]) > radius * (1.0 - 0.5 / divisions**2),
            "ends": lambda p: (p[2] < 1e-9) | (p[2] > thickness - 1e-9),
        }
    )
    law = Isotropic(youngs_modulus=10e3, poissons_ratio=0.3)
    supports = {"rim": Support(faces=("rim",)), "ends": Support(faces=("ends",), fixed=("x", "y"))}
    return TissueModel(mesh, TETRAHEDRON, {BACKGROUND: law}, supports, ("x", "y", "z"))


def test_give_of_a_thick_shaft_in_a_cylinder() -> None:
    """F6: w = q / (2 pi mu) (ln(R / a) + 1 / 4), the mean over a disc of evenly spread force."""
    radius, thick, thickness, limit = 0.03, 0.003, 0.002, 5.0
    shear, errors = 10e3 / 2.6, []
    for divisions in (6, 12):
        model = slab(radius, thickness, divisions)
        ends = np.array([0.0, 0.0, 0.0]), np.array([0.0, 0.0, thickness])
        needle = EmbeddedShaft(model, ends, 1, limit, thickness=thick)
        assert needle.move(1.0) == pytest.approx(limit * thickness)
        exact = limit / (2.0 * np.pi * shear) * (np.log(radius / thick) + 0.25)
        errors.append(abs(needle.moved[0] / exact - 1.0))
    assert errors[1] < 0.02
    assert errors[1] < 0.5 * errors[0]
