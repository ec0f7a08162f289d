"""Properties of a scene's needle on its mesh."""

import numpy as np

from needlefem.checks.result import CheckResult
from needlefem.fem.mesh import cell_sizes
from needlefem.insertion.simulation import Simulation
from needlefem.needle.contact import Contact

STICK_CONDITION = 1e9
"""Condition of the response of what sticks from which on its forces are noise: round-off of the
responses, 1e-15, then shows in them at 1e-6."""


def needle_resolution(simulation: Simulation) -> CheckResult:
    """Check that the mesh is not blind to the needle: elements of at most four tip radii.

    Accurate answers need half a tip radius, of which `resolve` warns; beyond four radii the
    mesh alone decides where the needle goes. The cells on the case's own line are measured.
    """
    model, scene = simulation.model, simulation.scene
    entry = simulation.entry_of_case()
    depths = np.linspace(0.0, scene.motion.max_depth, 200)[1:]
    line = entry.point + depths[:, None] * simulation.direction
    cells = model.interpolation.locator.find(line)[0]
    return CheckResult(
        name="needle resolution",
        requirement="elements along the needle are at most four tip radii large",
        value=float(cell_sizes(model.mesh)[cells[cells >= 0]].max()) / scene.needle.tip_radius,
        bound=4.0,
    )


def sticking_pieces(simulation: Simulation) -> CheckResult:
    """Check that the tissue can tell the pieces of the path apart when all of them stick.

    The condition of their axial response along the case's own line is found. Pieces that are
    much shorter than the distance of nodes move alike: the forces between them are noise, and
    with them what sticks and what slips.
    """
    entry = simulation.entry_of_case()
    instrument, scene = simulation.instrument(entry), simulation.scene
    axis, spacing = instrument.axis, instrument.spacing
    contact = Contact(simulation.responses, axis.frame)
    count = max(2, int(scene.motion.max_depth / spacing))
    hold = 1.0 / (instrument.lateral_stiffness * spacing)
    for number in range(count):
        ends = axis.tip((number + 1) * spacing), axis.tip(number * spacing)
        trial = contact.try_functionals(instrument.tip_and_piece(*ends))
        contact.adopt(trial, 1, 0.0, np.zeros(len(axis.laterals)), hold)
    give = scene.needle.stick_stiffness * spacing
    compliance = contact.sliding().compliance + (np.eye(count) / give if give else 0.0)
    values = np.linalg.eigvalsh(compliance)
    return CheckResult(
        name="sticking pieces",
        requirement="pieces of the path are long enough for the mesh to tell their sticking apart; "
        "lengthen discretisation.path_spacing or give needle.stick_stiffness",
        value=float(values[-1] / max(values[0], 1e-300)),
        bound=STICK_CONDITION,
    )
