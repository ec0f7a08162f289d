"""A scene made ready for insertions by the paper's method: nodes on the needle, in time."""

import dataclasses
from functools import cached_property

import numpy as np

from needlefem.alterovitz2003.insertion import ConformingInsertion
from needlefem.alterovitz2003.node_chain import NoNodeError
from needlefem.alterovitz2003.tissue_in_time import TissueInTime
from needlefem.dynamics import Damping, Newmark
from needlefem.errors import SimulationError
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.result import Insertion, Outcome, Status
from needlefem.insertion.simulation import Simulation, Stop, Watch
from needlefem.insertion.state import State
from needlefem.mesh.surface import Entry
from needlefem.scene import Scene

CALM = Newmark(beta=0.3025, gamma=0.6)
DAMPING = Damping(mass_rate=5.0, stiffness_time=2e-3)
APART = 0.25
"""Distance of the material points of kept states, at least, relative to the way of a step."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class InTime:
    """Numbers of the paper's method (R. Alterovitz et al., IROS 2003).

    Parameters
    ----------
    step : float, s
        The paper's.
    integrator : Newmark
        Of a little numerical damping: average acceleration rings under a prescribed motion.
    damping : Damping
        Not given in the paper: an assumption.
    spread : bool
        Whether forces are spread over the needle's thickness; the paper's act on nodes.
    refactor : bool
        Whether the operator is factorised anew for every node that the tip takes on.
    """

    step: float = 1.0 / 30.0
    integrator: Newmark = CALM
    damping: Damping = DAMPING
    spread: bool = False
    refactor: bool = False


class NodeSimulation(Simulation):
    """Insertions by the paper's method; otherwise as `Simulation`.

    What an insertion returns has no pieces: a path of nodes belongs to a mesh that moves.

    Parameters
    ----------
    scene : Scene
        Of P1 triangles.
    numbers : InTime
    model : TissueModel, optional
    watch : callable, optional

    Attributes
    ----------
    time_steps, waited : int
        Time steps of all insertions so far, and those in which a tip found no place to go.

    Raises
    ------
    CaseError
        The scene can't be built, or has other elements.
    """

    def __init__(
        self, scene: Scene, numbers: InTime | None = None, model: TissueModel | None = None,
        watch: Watch | None = None,
    ) -> None:  # fmt: skip
        super().__init__(scene, model, watch)
        self.numbers = numbers or InTime()
        self.time_steps = self.waited = 0

    @cached_property
    def tissue(self) -> TissueInTime:
        """The tissue in time, shared by all insertions."""
        n = self.numbers
        return TissueInTime(self.model, n.integrator, n.step, n.damping, refactor=n.refactor)

    def insert(
        self, entry: Entry, stop: Stop | None = None, *, max_depth: float | None = None
    ) -> Insertion:
        """Push the needle in at the motion's speed; see `Simulation.insert`."""
        motion, needle = self.scene.motion, self.instrument(entry)
        self.insertions += 1
        try:
            pushed = ConformingInsertion(
                needle, self.tissue, spread=self.numbers.spread,
                grip=self.scene.needle.static_friction,
            )  # fmt: skip
        except NoNodeError as error:
            raise SimulationError(f"{error}; refine the mesh") from error
        end = motion.max_depth if max_depth is None else max_depth
        count = int(np.ceil(end / (motion.speed * self.numbers.step) - 1e-9))
        depths = motion.speed * self.numbers.step * np.arange(1, count + 1)
        depths[-1] = end  # the last step is as long as the others, and goes less far
        states: list[State] = []
        for state in pushed.iterate(depths):
            _keep(states, state, APART * motion.speed * self.numbers.step)
            if self._watch is not None:
                self._watch(state)
            if stop is not None and stop(state):
                break
        self.time_steps += pushed.steps
        self.waited += pushed.waited
        return Insertion(
            scene=self.scene,
            model=self.model,
            instrument=needle,
            outcome=_outcome(pushed.outcome, states),
            states=tuple(states),
            pieces=(),
            snaps=(),
            evaluations=pushed.contact.evaluations,
        )


def _keep(states: list[State], state: State, least: float) -> None:
    """Keep the first touch, the puncture, and from there on states at least so far apart, m.

    Of others the last is kept: with a new node at the tip, the path may stand still for a step.
    """
    if not states:
        states.append(dataclasses.replace(state, depth=0.0, time=0.0, tip_force=0.0))
    elif len(states) == 2 and len(state.friction_force) and not len(states[-1].friction_force):
        last = states[-1]  # the skin gives way between this state and the next
        states[-1] = dataclasses.replace(last, tip_force=max(last.tip_force, last.cutting_force))
    elif len(states) > 1 and float(np.linalg.norm(state.tip - states[-1].tip)) < least:
        states.pop()
    states.append(state)


def _outcome(outcome: Outcome, states: list[State]) -> Outcome:
    if outcome.status is Status.COMPLETED and not len(states[-1].friction_force):
        sentence = f"the skin is not cut at {states[-1].depth:.4g} m, the largest depth"
        return Outcome(Status.NOT_PUNCTURED, sentence)
    return outcome
