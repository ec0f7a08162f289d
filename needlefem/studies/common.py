"""What studies share."""

import numpy as np

from needlefem.errors import CaseError
from needlefem.insertion.simulation import Simulation
from needlefem.insertion.trajectory import TipPoint
from needlefem.planning.planner import Planner
from needlefem.planning.reading import InsertionReader
from needlefem.planning.result import Plan
from needlefem.scene import Scene, vary


def planner_of(scene: Scene) -> Planner:
    """Return a planner for the scene's own target."""
    if scene.target is None:
        raise CaseError("target.point", "missing", "the study needs a target")
    return Planner(Simulation(scene), np.array(scene.target))


def carry_out(scene: Scene, plan: Plan) -> TipPoint | None:
    """Return where a planned release ends in another scene; None if it is not reached there.

    Nor is it where the insertion breaks off, or is deeper than the scene's motion may go.
    """
    if plan.best is None:
        return None
    direction = tuple(plan.insertion.axis.direction.tolist())
    simulation = Simulation(vary(scene, {"motion.direction": direction}))
    release = plan.best.release_point
    entry = simulation.entry_through(release)
    depth = float(simulation.direction @ (release - entry.point))
    insertion = simulation.insert(entry, lambda state: state.depth > depth + 3e-3)
    return InsertionReader(insertion, plan.target).at_depth(depth).reach
