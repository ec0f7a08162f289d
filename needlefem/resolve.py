"""The one place that decides: what a scene needs, and what it can do without."""

import dataclasses
import math

from needlefem.elements import element_row
from needlefem.scene import Discretisation, Scene

MARCH = "march"
FEWEST_KERNEL_POINTS, MOST_KERNEL_POINTS = 48, 400


@dataclasses.dataclass(frozen=True)
class Resolved:
    """A concrete scene and why it is as it is.

    Parameters
    ----------
    scene : Scene
        Without anything left to choose.
    reasons : dict
        A sentence for every choice.
    skipped : dict
        What the scene doesn't need, and why.
    warnings : tuple of str
        What the user should know before believing a result.
    """

    scene: Scene
    reasons: dict[str, str]
    skipped: dict[str, str]
    warnings: tuple[str, ...]


def resolve(scene: Scene) -> Resolved:
    """Return the scene with every 'auto' replaced, the reasons, the skips and the warnings."""
    reasons: dict[str, str] = {}
    discretisation = _discretisation(scene, reasons)
    concrete = dataclasses.replace(scene, discretisation=discretisation)
    return Resolved(concrete, reasons, _skips(), tuple(_warnings(concrete)))


def _discretisation(scene: Scene, reasons: dict[str, str]) -> Discretisation:
    chosen = scene.discretisation
    if chosen.element == "auto":
        reasons["element"] = "P2: the cheapest element that does not lock below nu = 0.49"
        chosen = dataclasses.replace(chosen, element="P2")
    element_row(chosen.element)
    if chosen.kernel_points == 0:
        spacing = tip_element_size(scene) / 3.0
        wanted = math.pi * (scene.needle.tip_radius / spacing) ** scene.dim
        points = max(FEWEST_KERNEL_POINTS, min(MOST_KERNEL_POINTS, math.ceil(wanted)))
        reasons["kernel_points"] = f"{points}: three points per element length inside the kernel"
        chosen = dataclasses.replace(chosen, kernel_points=points)
    return chosen


def tip_element_size(scene: Scene) -> float:
    """Return the element size along the needle that the mesh is asked for, m."""
    mesh = scene.mesh
    squares = [length / n for length, n in zip(mesh.size, mesh.divisions, strict=True)]
    coarse = max(squares) / (math.sqrt(2.0) if mesh.pattern == "crossed" else 1.0)
    wanted = mesh.refine.corridor_size
    return min(wanted, coarse) if wanted > 0.0 else coarse


def _skips() -> dict[str, str]:
    return {
        "dynamics": "quasi-static: one slow insertion; inertia is below tolerance",
        "time_steps": "monotone insertion with all points slipping: marched along the path",
        "reassembly": "the stiffness is constant: one factorisation",
        "responses_elsewhere": "only the needle's corridor is touched",
        "retraction": "elastic tissue and the first seed: it comes to rest where it was released",
        "mass_and_damping": "not used by a quasi-static insertion",
        "full_fields": "recovered only for the states that are checked, drawn or written",
    }


def _warnings(scene: Scene) -> list[str]:
    found: list[str] = []
    row = element_row(scene.discretisation.element)
    for name, material in scene.materials.items():
        if material.poissons_ratio > row.poissons_ratio_limit:
            cure = (
                "P2" if row.name == "P1" and material.poissons_ratio <= 0.49 else "a mixed element"
            )
            found.append(
                f"{row.name} locks at Poisson's ratio {material.poissons_ratio:g} of '{name}': "
                f"the tissue is too stiff; use {cure}"
            )
    radius = scene.needle.tip_radius
    if scene.needle.tip == "point":
        found.append("a point tip never converges: the answer drifts with every refinement")
    elif tip_element_size(scene) > 0.55 * radius:
        found.append(
            f"elements along the needle ({tip_element_size(scene) * 1e3:.2g} mm) are larger than "
            f"half the tip's radius ({radius * 1e3:.2g} mm): refine the corridor"
        )
    least = tip_element_size(scene) / row.degree
    if scene.discretisation.path_spacing < 0.3 * least:
        found.append(
            f"the path spacing is below a third of the node distance ({least * 1e3:.2g} mm): "
            "only the lateral stiffness keeps the shaft's forces from becoming noise"
        )
    return found
