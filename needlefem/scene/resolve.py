"""Automatic choices for a scene: integrator, element, tip quadrature, omitted computations."""

import dataclasses
import math
from itertools import pairwise

from needlefem._plugin import is_foreign
from needlefem.elements import ElementType, element_row
from needlefem.errors import CaseError
from needlefem.materials import Material, branches_of, volumetric_split
from needlefem.scene.discretization import DYNAMIC, BoxMesh, Discretization, FileMesh
from needlefem.scene.schema import Motion, Scene
from needlefem.scene.varying import vary

SLOW = 0.01
"""Speed of the needle over that of shear waves below which inertia moves the seed by less than
0.01 mm (``needlefem study dynamics``)."""
SHORT = 1e-3
"""Delay due to damping, over the duration of an insertion, below which the effect is as small."""


def integrator_for(scene: Scene, needs: str) -> tuple[str, str]:
    """Return the integrator that the scene needs, and the reason."""
    speed, wave, lag = fastest(scene.motion), slowest_wave(scene), damping_time(scene)
    duration = scene.motion.max_depth / speed
    if speed > SLOW * wave:
        share = f"{speed:.3g} m/s are {100 * speed / wave:.2g} % of the shear wave's"
        return "generalized_alpha", f"inertia matters, for the needle's {share}"
    if lag > SHORT * duration and math.isfinite(wave):
        share = f"{lag:.2g} s of {duration:.2g} s of insertion"
        return "generalized_alpha", f"damping matters, for it delays the tissue by {share}"
    slow = f"{speed:.3g} m/s are slow for a shear wave of {wave:.2g} m/s"
    if needs:
        return "quasi_static", f"{needs}; {slow}"
    return (
        "path_following",
        f"an insertion begins, in elastic tissue with one friction limit; {slow}",
    )


def fastest(motion: Motion) -> float:
    """Return the largest speed of the needle in a motion, m/s."""
    speeds = [stage.speed or motion.speed for stage in motion.stages if stage.depth is not None]
    for (t0, s0), (t1, s1) in pairwise(zip(motion.times, motion.depths, strict=False)):
        speeds.append(abs(s1 - s0) / (t1 - t0) if t1 > t0 else motion.speed)
    return max(speeds, default=motion.speed) or motion.speed


def slowest_wave(scene: Scene) -> float:
    """Return the speed of the slowest shear wave, m/s; infinite if a material has no mass."""
    laws = scene.materials.values()
    if not all(law.density for law in laws):
        return math.inf
    return min(math.sqrt(volumetric_split(law).shear / law.density) for law in laws)


def damping_time(scene: Scene) -> float:
    """Return the time by which damping delays the slowest motion, s.

    It is ``c / k`` of a mode with half a wavelength over the largest depth, or ``2 zeta / w`` of a
    damping ratio.
    """
    said, wave = scene.damping, slowest_wave(scene)
    pairs = zip(said.frequencies, said.ratios, strict=False)
    given = [ratio / (math.pi * frequency) for frequency, ratio in pairs]
    omega = math.pi * wave / scene.motion.max_depth
    return max([*given, said.stiffness_time + said.mass_rate / omega**2])


def needs_steps(scene: Scene) -> str:
    """Return why path following is not possible from the start; empty if it is possible."""
    if any(branches_of(law, scene.dim, scene.plane) for law in scene.materials.values()):
        return "viscoelastic tissue depends on time"
    if scene.needle.static_friction_ratio > 1.0 or scene.needle.tangential_penalty > 0.0:
        return "friction depends on slip"
    return ""


# Choices that a scene leaves open, and work that it does not need.


CHEAPEST = {"triangle": ("P2", "P2-P1", 0.46), "quadrilateral": ("Q2", "Q2-Q1", 0.485)}
"""For each shape of cells: the element that is fastest to an accuracy, the mixed element, and the
Poisson's ratio above which the mixed element is faster (``needlefem bench elements``)."""
SHORT_SEGMENT = 0.75
"""Length of a contact segment over the element size above which sticking is smooth
(``verification/friction/multiplier_noise.py``)."""
POINTS_PER_NODE_DISTANCE = 3.5
"""Quadrature points of the tip kernel per distance of nodes: their placement error is less than a
tenth of that of the mesh (``tests/needle/test_kernel_points.py``)."""
FEWEST_KERNEL_POINTS, MOST_KERNEL_POINTS, MOST_IN_3D = 48, 1200, 400
POINTS_ON_FILE_MESH = 400
"""Quadrature points for a mesh from a file, whose sizes are not known before it is read."""


@dataclasses.dataclass(frozen=True)
class Resolved:
    """A scene without open choices, and the reasons for the choices.

    Parameters
    ----------
    scene : Scene
        The scene with all choices made.
    reasons : dict
        A sentence for each choice.
    skipped : dict
        Computations that the scene does not need, and the reasons.
    warnings : tuple of str
        Limitations of the results.
    """

    scene: Scene
    reasons: dict[str, str]
    skipped: dict[str, str]
    warnings: tuple[str, ...]


def resolve(scene: Scene) -> Resolved:
    """Return the scene with each 'auto' replaced, the reasons, skipped work and warnings."""
    reasons: dict[str, str] = {}
    discretisation = _discretisation(scene, reasons)
    concrete = dataclasses.replace(scene, discretization=discretisation)
    return Resolved(concrete, reasons, _skips(concrete), tuple(_warnings(concrete)))


def _discretisation(scene: Scene, reasons: dict[str, str]) -> Discretization:
    chosen = scene.discretization
    if chosen.element == "auto":
        name, why = _element(scene)
        reasons["element"] = f"{name}: {why}"
        chosen = dataclasses.replace(chosen, element=name)
    row = element_row(chosen.element)
    if not is_foreign(chosen.element):  # in another spelling, perhaps
        chosen = dataclasses.replace(chosen, element=row.name)
    if chosen.tip_quadrature_points == 0:
        points = tip_quadrature_points(scene, row)
        reasons["tip_quadrature_points"] = (
            f"{points}: {POINTS_PER_NODE_DISTANCE:g} points per node distance inside the kernel"
        )
        chosen = dataclasses.replace(chosen, tip_quadrature_points=points)
    needs = needs_steps(scene)
    if chosen.integrator == "path_following" and needs:
        remedy = "write 'quasi_static' or 'auto'"
        raise CaseError("discretization.integrator", f"'path_following', but {needs}", remedy)
    if chosen.integrator != "auto":
        reasons["integrator"] = f"{chosen.integrator}: asked for"
        return chosen
    name, why = integrator_for(scene, needs)
    reasons["integrator"] = f"{name}: {why}"
    return dataclasses.replace(chosen, integrator=name)


def with_element(scene: Scene, name: str) -> Scene:
    """Return the scene with another element; a box mesh gets the cells of the element."""
    changes: dict[str, object] = {"discretization.element": name}
    cell = element_row(name).cell
    if isinstance(scene.mesh, BoxMesh) and cell != cell_shape(scene):
        changes["mesh.pattern"] = "quadrilateral" if cell == "quadrilateral" else "diagonal"
    return vary(scene, changes)


def cell_shape(scene: Scene) -> str:
    """Return the shape of the cells of the scene's mesh."""
    if isinstance(scene.mesh, FileMesh):
        return scene.mesh.cell
    return "quadrilateral" if scene.mesh.pattern == "quadrilateral" else "triangle"


def _ratio(scene: Scene, material: Material) -> float:
    """Return the Poisson's ratio of a law that determines whether an element locks.

    In plane stress the strain in the third direction is free, so that no element locks.
    """
    return 0.0 if scene.plane == "stress" else volumetric_split(material).poissons_ratio


def cheapest(ratio: float) -> tuple[str, ...]:
    """Return the elements that are chosen for a Poisson's ratio, one for each shape of cells."""
    return tuple(
        mixed if ratio > overtakes else plain for plain, mixed, overtakes in CHEAPEST.values()
    )


def quadratic(scene: Scene) -> str:
    """Return the quadratic element of the scene's cells; a mixed one if the other would lock."""
    plain, mixed, _ = CHEAPEST[cell_shape(scene)]
    worst = max(_ratio(scene, material) for material in scene.materials.values())
    return plain if worst <= element_row(plain).poissons_ratio_limit else mixed


def _element(scene: Scene) -> tuple[str, str]:
    """Return the element that is fastest to an accuracy in the scene, and the reason."""
    plain, mixed, overtakes = CHEAPEST[cell_shape(scene)]
    worst = max(_ratio(scene, material) for material in scene.materials.values())
    if worst > overtakes:
        return mixed, f"its pressure carries Poisson's ratios such as {worst:.6g} without locking"
    return plain, f"the fastest to an accuracy below nu = {overtakes:g}"


def tip_quadrature_points(scene: Scene, row: ElementType) -> int:
    """Return the number of quadrature points of the tip kernel for a scene with an element."""
    size = tip_element_size(scene)
    if size is None:
        return POINTS_ON_FILE_MESH
    density = POINTS_PER_NODE_DISTANCE * row.degree / size
    wanted = math.ceil(math.pi * (density * scene.needle.tip_radius) ** scene.dim)
    most = MOST_KERNEL_POINTS if scene.dim == 2 else MOST_IN_3D
    return max(FEWEST_KERNEL_POINTS, min(most, wanted))


def tip_element_size(scene: Scene) -> float | None:
    """Return the requested element size along the needle, m.

    None for a mesh from a file, whose sizes are fixed.
    """
    mesh = scene.mesh
    if isinstance(mesh, FileMesh):
        return None
    squares = [length / n for length, n in zip(mesh.size, mesh.divisions, strict=True)]
    coarse = max(squares) / (math.sqrt(2.0) if mesh.pattern == "crossed" else 1.0)
    wanted = mesh.refine.corridor_size
    return min(wanted, coarse) if wanted > 0.0 else coarse


def _skips(scene: Scene) -> dict[str, str]:
    found = {
        "dynamics": "quasi-static: one slow insertion; inertia is below tolerance",
        "time_steps": "monotone insertion with all points slipping: path following",
        "reassembly": "the stiffness is constant: one factorisation",
        "responses_elsewhere": "only nodes near the needle carry forces",
        "retraction": "elastic tissue and the first seed: it comes to rest where it was released",
        "mass_and_damping": "not used by a quasi-static insertion",
        "full_fields": "recovered only for the states that are checked, drawn or written",
        "pictures": "their modules are imported only when they are requested",
        "further_insertions": "a search ends when the error is within its tolerance",
        "repetition": "all insertions share assembly, factorisation and responses",
    }
    if not scene.planning.estimate:
        found["estimate"] = "the error estimate was not requested"
    motion = scene.motion
    if scene.discretization.integrator != "path_following" or motion.stages or motion.times:
        del found["time_steps"], found["retraction"]
    if scene.discretization.integrator in DYNAMIC:
        del found["dynamics"], found["mass_and_damping"]
    return found


def _warnings(scene: Scene) -> list[str]:
    row = element_row(scene.discretization.element)
    return [
        *_locking(scene, row),
        *_tip_warnings(scene, row),
        *_spacing_warnings(scene, row),
        *_friction_warnings(scene),
        *stick_warnings(scene),
    ]


def _friction_warnings(scene: Scene) -> list[str]:
    needle = scene.needle
    if needle.static_friction_ratio > 1.0 and needle.slip_weakening_distance == 0.0:
        return [
            "friction drops at once from static to kinetic: the answer depends on the time step; "
            "give needle.slip_weakening_distance"
        ]
    return []


def stick_warnings(scene: Scene) -> list[str]:
    """Return a warning if the friction of sticking segments alternates along the needle."""
    size, needle = tip_element_size(scene), scene.needle
    steps = (
        scene.motion.stages
        or scene.motion.times
        or scene.discretization.integrator != "path_following"
    )
    if not steps or size is None or needle.tangential_penalty > 0.0:
        return []
    if scene.discretization.path_spacing >= SHORT_SEGMENT * size:
        return []
    return [
        f"the path spacing is below the element size along the needle ({size * 1e3:.2g} mm): the "
        "friction of sticking segments alternates from segment to segment; lengthen it or give "
        "needle.tangential_penalty (1e9 N/m^3 is enough)"
    ]


def _locking(scene: Scene, row: ElementType) -> list[str]:
    found = []
    plain, mixed, _ = CHEAPEST[cell_shape(scene)]
    for name, material in scene.materials.items():
        ratio = _ratio(scene, material)
        if ratio > row.poissons_ratio_limit:
            cure = plain if ratio <= element_row(plain).poissons_ratio_limit else mixed
            found.append(
                f"{row.name} locks at Poisson's ratio {ratio:.6g} of '{name}': "
                f"the tissue is too stiff; use {cure}"
            )
    return found


def _tip_warnings(scene: Scene, row: ElementType) -> list[str]:
    if scene.needle.tip == "point":
        return ["a point tip does not converge: each refinement changes the result"]
    radius, size = scene.needle.tip_radius, tip_element_size(scene)
    if size is not None and size / row.degree > 0.55 * radius:
        return [
            f"nodes along the needle ({size / row.degree * 1e3:.2g} mm apart) are further apart "
            f"than half the tip's radius ({radius * 1e3:.2g} mm): refine the corridor"
        ]
    return []


def _spacing_warnings(scene: Scene, row: ElementType) -> list[str]:
    size = tip_element_size(scene)
    if size is None or scene.discretization.path_spacing >= 0.3 * size / row.degree:
        return []
    return [
        f"the path spacing is below a third of the node distance ({size / row.degree * 1e3:.2g} "
        "mm): without the lateral penalty the shaft forces would be dominated by round-off"
    ]
