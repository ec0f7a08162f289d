"""Whether the tissue can tell apart what sticks to the needle."""

import numpy as np

from needlefem.checks.result import CheckResult
from needlefem.insertion.simulation import Simulation
from needlefem.needle.friction import Friction, stick_condition
from needlefem.needle.straight import straight_path

STICK_CONDITION = 1e9
"""Condition of the response of what sticks from which on its forces are noise: round-off of the
responses, 1e-15, then shows in them at 1e-6."""


def sticking_pieces(simulation: Simulation) -> CheckResult:
    """Check that the tissue can tell the pieces of the path apart when all of them stick.

    The condition of their axial response along the case's own line is found. Pieces that are
    much shorter than the distance of nodes move alike: the forces between them are noise, and
    with them what sticks and what slips.
    """
    entry = simulation.entry_of_case()
    instrument, scene = simulation.instrument(entry), simulation.scene
    spacing = instrument.spacing
    count = max(2, int(scene.motion.max_depth / spacing))
    path = straight_path(instrument, simulation.responses, count)
    slack = Friction(stiffness=scene.needle.stick_stiffness).slack(np.full(count, spacing))
    return CheckResult(
        name="sticking pieces",
        requirement="pieces of the path are long enough for the mesh to tell their sticking apart; "
        "lengthen discretisation.path_spacing or give needle.stick_stiffness",
        value=stick_condition(path.sliding().compliance, slack),
        bound=STICK_CONDITION,
    )
