"""Insertions by the method of 2003: nodes of the mesh on the needle, time stepping."""

import dataclasses
from collections.abc import Iterable, Iterator
from functools import cached_property

import numpy as np

from needlefem._arrays import Vector
from needlefem._root_finding import updated_jacobian
from needlefem.alterovitz2003.contact import ActiveSetSolution, NodeContact
from needlefem.alterovitz2003.moving_tissue import MovingTissue, Response, TissueInTime
from needlefem.alterovitz2003.node_chain import (
    LEAST_AREA,
    NeedleFunctionals,
    NodeChain,
    NoNodeError,
)
from needlefem.dynamics import Damping, KinematicState, Newmark
from needlefem.errors import CaseError, SimulationError
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.insertion_run import SaveAt
from needlefem.insertion.result import Insertion, Outcome, Status
from needlefem.insertion.simulation import Simulation, Stop, Watch
from needlefem.insertion.state import State, TipPhase
from needlefem.mesh.surface import Entry
from needlefem.needle.needle_interface import NeedleInterface
from needlefem.scene import Scene

CALM = Newmark(beta=0.3025, gamma=0.6)
DAMPING = Damping(mass_rate=5.0, stiffness_time=2e-3)
APART = 0.25
"""Smallest distance of the material points of stored states, relative to that of a step."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class InTime:
    """Parameters of the paper's method (R. Alterovitz et al., IROS 2003).

    Parameters
    ----------
    step : float, s
        Time step of the paper.
    integrator : Newmark
        With a small numerical damping; the average acceleration would oscillate under a prescribed
        motion.
    damping : Damping
        An assumption; the paper does not state it.
    spread : bool
        Whether forces are distributed over the needle's thickness; in the paper they act on nodes.
    refactor : bool
        Whether a new factor is computed for each new tip node.
    """

    step: float = 1.0 / 30.0
    integrator: Newmark = CALM
    damping: Damping = DAMPING
    spread: bool = False
    refactor: bool = False


class NodeSimulation(Simulation):
    """Insertions by the paper's method, with the interface of `Simulation`.

    The insertion has no contact segments, because a path of nodes belongs to a moved mesh.

    Parameters
    ----------
    scene : Scene
        With P1 triangles.
    numbers : InTime
    model : TissueModel, optional
    watch : callable, optional

    Attributes
    ----------
    time_steps, waited : int
        Time steps of all insertions so far, and those in which no node could follow the tip.

    Raises
    ------
    CaseError
        The scene is not valid, or has another element.
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
        """The tissue in time, which all insertions share."""
        n = self.numbers
        return TissueInTime(self.model, n.integrator, n.step, n.damping, refactor=n.refactor)

    def insert(
        self,
        entry: Entry,
        stop: Stop | None = None,
        *,
        max_depth: float | None = None,
        save: SaveAt | None = None,
    ) -> Insertion:
        """Simulate an insertion at the speed of the motion; see `Simulation.insert`.

        All states are kept, without the displacement of the tissue.
        """
        if save is not None:
            problem = "not available with the conforming coupling of the 2003 method"
            raise CaseError("save", problem, "leave it out")
        motion, needle = self.scene.motion, self.instrument(entry)
        self.insertions += 1
        try:
            pushed = ConformingInsertion(
                needle, self.tissue, spread=self.numbers.spread,
                grip=self.scene.needle.static_friction_ratio,
            )  # fmt: skip
        except NoNodeError as error:
            raise SimulationError(f"{error}; refine the mesh") from error
        end = motion.max_depth if max_depth is None else max_depth
        count = int(np.ceil(end / (motion.speed * self.numbers.step) - 1e-9))
        depths = motion.speed * self.numbers.step * np.arange(1, count + 1)
        depths[-1] = end  # the last step has the same duration and a shorter travel
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
            segments=(),
            ruptures=(),
            contact_solves=pushed.contact.evaluations,
        )


def _keep(states: list[State], state: State, least: float) -> None:
    """Yield the first contact, the puncture, and then states with a smallest distance, m.

    Of closer states the last one is kept; with a new tip node the path may not grow in a step.
    """
    if not states:
        states.append(dataclasses.replace(state, depth=0.0, time=0.0, tip_force=0.0))
    elif len(states) == 2 and len(state.friction_force) and not len(states[-1].friction_force):
        last = states[-1]  # the puncture is between this state and the next
        states[-1] = dataclasses.replace(last, tip_force=max(last.tip_force, last.cutting_force))
    elif len(states) > 1 and float(np.linalg.norm(state.tip - states[-1].tip)) < least:
        states.pop()
    states.append(state)


def _outcome(outcome: Outcome, states: list[State]) -> Outcome:
    if outcome.status is Status.COMPLETED and not len(states[-1].friction_force):
        sentence = f"the skin is not cut at {states[-1].depth:.4g} m, the largest depth"
        return Outcome(Status.NOT_PUNCTURED, sentence)
    return outcome


# An insertion with nodes of the mesh on the needle, in time steps.
#
# The coupling is that of R. Alterovitz et al., IROS 2003, section IV: a tip node, and previous tip
# nodes on the shaft, which stick or slide. The tip loads its material point until the force reaches
# the cutting force. Its node is then moved ahead in the undeformed mesh until its deformed position
# under the cutting force is the position of the tip. During a retraction the needle leaves one node
# after the other, and they return to their original positions.


TOLERANCE = 1e-6
"""Largest distance between tip and tip node at the end of a step, m.

A hundredth of the tolerance of the paper's search.
"""
RASTER = 1e-8
"""The coordinates of the tip node are multiples of this length, m: a hundredth of the tolerance.

The round-off of the response, about 1e-14 m, differs between processors and libraries. In an
ill-conditioned step it would be amplified until another node is moved, and the tip would end a
fraction of a millimetre elsewhere. With rounded coordinates the moved mesh is the same everywhere.
"""
MOST_ITERATIONS, MOST_HALVINGS = 20, 10
SLOPES = (0.2, 1.5)
"""Smallest and largest expected advance of the tip in a step, per travel of the needle."""
REACHES = (1.0, 4.0, 16.0)
"""Factor on the search distance ahead if no position is found, as after a rupture."""
LEAST_TRAVEL = 1e-6
"""Travel, m, for the search ahead while the needle rests."""
FORWARD = 1e-9
"""Smallest advance of a cutting tip in a step, m; below it the tip does not advance."""

Found = tuple[Vector, Response, ActiveSetSolution]


class ConformingInsertion:
    """A needle whose tip and shaft are nodes of the mesh.

    Parameters
    ----------
    instrument : NeedleInterface
    tissue : TissueInTime
    spread : bool
        Whether forces are distributed over kernel and section; else each acts on its node, as in
        the paper.
    grip : float
        Ratio of static to kinetic friction.
        Static over kinetic friction.

    Attributes
    ----------
    outcome : Outcome
        Status at the end of `iterate`.
    waited : int
        Steps in which a cutting tip could not advance, because no node could follow it.
    steps : int
        Number of time steps so far.
    """

    def __init__(
        self, instrument: NeedleInterface, tissue: TissueInTime, *, spread: bool, grip: float = 1.0
    ) -> None:
        self.axis = instrument.axis
        self.tissue = MovingTissue(tissue, instrument.axis.frame)
        self.chain = NodeChain(self.tissue.mesh, instrument.axis)
        self.touch = NeedleFunctionals(instrument, self.tissue.mesh, spread=spread)
        self.contact = NodeContact(self.tissue, self.chain, self.touch, grip)
        self.outcome = Outcome(Status.STOPPED, "stopped by the caller")
        self.depth = self._waiting = 0.0
        self.waited = self.steps = 0
        self._way = TipPhase.LOADING
        self._loose: list[int] | None = None
        self._slope = 0.5 * self.axis.direction  # advance of the tip per travel of the needle
        self._jacobian = np.eye(2)

    def iterate(self, depths: Iterable[float]) -> Iterator[State]:
        """Yield the state at each depth; one time step leads from each to the next."""
        try:
            for depth in depths:
                yield self.advance(float(depth))
            self.outcome = Outcome(Status.COMPLETED, f"reached {self.depth:.4g} m")
        except NoNodeError as error:
            self.outcome = Outcome(Status.NO_NODE, str(error))
        except SimulationError as error:
            self.outcome = Outcome(Status.NOT_CONVERGED, str(error))

    def advance(self, depth: float) -> State:
        """Make a time step that ends at a given depth.

        Raises
        ------
        NoNodeError
            No node could follow the tip over more than the distance of the next ones.
        SimulationError
            No equilibrium was found, or a retracted needle is inserted again.
        """
        travel = depth - self.depth
        if travel < 0.0:
            self._way = TipPhase.RETRACTED
        if self._way is TipPhase.RETRACTED:
            if travel > 0.0:
                raise SimulationError("a retracted needle can't be inserted again")
            self._withdraw(depth)
        elif not (self._way is TipPhase.CUTTING and travel > 0.0 and self._cut(depth)):
            self._hold(depth)
        self.depth = depth
        self.steps += 1
        return self.contact.state(depth, self.steps * self.tissue.shared.stepper.step, self._way)

    def _hold(self, depth: float) -> None:
        """Keep the tip's material point, or begin to cut if the force reaches the cutting force."""
        point, travel = self.chain.tip, depth - self.depth
        self.tissue.begin()
        response, settled = self.contact.evaluate(point, depth, travel, TipPhase.LOADING)
        if not settled.held[-2] and settled.forces[-2] > 0.0:
            if self._way is TipPhase.LOADING:
                if self._cut(depth):
                    return
                self.tissue.begin()
            response, settled = self.contact.evaluate(
                point, depth, travel, TipPhase.LOADING, endless=True
            )
        self._way = TipPhase.LOADING
        self.contact.finish(response, settled)

    def _cut(self, depth: float) -> bool:
        """Move the tip node ahead to the position of the tip; return whether it advanced."""
        mark, motion, memory = self.chain.mark(), self.tissue.motion, self.contact.memory
        travel = max(depth - self.depth + self._waiting, LEAST_TRAVEL)
        failed: Exception | None = None
        for reach in REACHES:
            self.tissue.motion = KinematicState(motion.u.copy(), motion.v.copy(), motion.a.copy())
            try:
                other, found = self._look_for(reach * travel * self._slope, depth)
            except (NoNodeError, SimulationError) as error:
                failed = failed or error
            else:
                way = found[0] - self.chain.tip
                if way @ self.axis.direction > FORWARD:
                    self._go(found)
                    if not other and travel > LEAST_TRAVEL:  # otherwise the path has a kink
                        self._slope = self._expected(way / travel)
                    return True
                failed = None
            self.chain.back_to(mark)
            self.tissue.motion = motion
            self.contact.look()
            self.contact.memory = memory
            if failed is None:
                return False
        if failed is not None:
            self._wait(depth - self.depth, failed)
        return False

    def _look_for(self, ahead: Vector, depth: float) -> tuple[bool, Found]:
        """Move the nearest node ahead of the tip, and solve for it; return if it is another one."""
        guess = self.chain.tip + ahead
        moves = self.chain.moves_to(guess)
        self.tissue.transfer(moves)
        other = self.chain.advance(moves)
        if other:
            self.contact.take_on()
        if other or self.touch.far(guess):
            self.contact.look()
        self.tissue.begin()
        return other, self._solve(guess, depth)

    def _go(self, found: Found) -> None:
        """Finish the step with the tip node at its position."""
        point, response, settled = found
        self.chain.mesh.place(self.chain.tip_node, point)
        self.chain.record(point)
        self._waiting, self._way = 0.0, TipPhase.CUTTING
        self.contact.finish(response, settled)

    def _expected(self, slope: Vector) -> Vector:
        """Return the expected advance of the next step, from the slope of the last one."""
        ahead = min(max(float(slope @ self.axis.direction), SLOPES[0]), SLOPES[1])
        sideways = float(self.axis.lateral_directions[0] @ slope)
        sideways = min(max(sideways, -SLOPES[0] * ahead), SLOPES[0] * ahead)
        expected: Vector = np.array([ahead, sideways]) @ self.axis.frame
        return expected

    def _wait(self, travel: float, error: Exception) -> None:
        """Do not advance, over at most the distance of the next nodes."""
        self._waiting += travel
        self.waited += 1
        if self._waiting > self.touch.size(self.chain.tip_node):
            raise error

    def _solve(self, point: Vector, depth: float) -> Found:
        """Solve for the position of the tip node by Broyden's method, in the order of the axes."""
        travel = depth - self.depth
        point = _on_raster(point)
        response, settled = self.contact.evaluate(point, depth, travel, TipPhase.CUTTING)
        for _ in range(MOST_ITERATIONS):
            residual = self._off(point, settled, depth)
            if np.max(np.abs(residual)) <= TOLERANCE:
                return point, response, settled
            wanted: Vector = -np.linalg.solve(self._jacobian, residual).astype(float, copy=False)
            there = _on_raster(point + self._allowed(point, wanted))
            change = there - point
            if not change.any():
                break
            point = there
            response, settled = self.contact.evaluate(point, depth, travel, TipPhase.CUTTING)
            reached = self._off(point, settled, depth)
            self._jacobian = updated_jacobian(self._jacobian, change, residual, reached)
        self._jacobian = np.eye(2)
        raise SimulationError(f"the position of the tip node did not converge at {depth:.4g} m")

    def _allowed(self, point: Vector, change: Vector) -> Vector:
        """Return a change that is halved until no cell is inverted."""
        for _ in range(MOST_HALVINGS):
            if self.tissue.ratio(point + change) >= 0.5 * LEAST_AREA:
                return change
            change = 0.5 * change
        raise NoNodeError("the tip node can't follow the tip: a cell would be inverted")

    def _off(self, point: Vector, settled: ActiveSetSolution, depth: float) -> Vector:
        """Return the distance vector between tip node and tip, shape (2,), m."""
        off: Vector = point + settled.moved[-2:] @ self.axis.frame - self.axis.tip_position(depth)
        return off

    def _withdraw(self, depth: float) -> None:
        """Retract the needle; nodes that it leaves return when no cell is inverted by that."""
        chain, mesh = self.chain, self.chain.mesh
        if self._loose is None:
            self._loose = [chain.tip_node]
        self.tissue.begin()
        point, travel = mesh.points[chain.tip_node], depth - self.depth
        self.contact.finish(*self.contact.evaluate(point, depth, travel, TipPhase.RETRACTED))
        where = self.axis.axial_coordinate(mesh.points[chain.nodes]) + self.contact.memory.before
        kept = int(np.count_nonzero(np.minimum.accumulate(where[::-1])[::-1] < depth))
        self._loose += [chain.drop() for _ in range(len(chain.shaft) - kept)]
        self.contact.keep(kept)
        for node in tuple(self._loose):
            home = ((node, mesh.home[node]),)
            if not kept or chain.valid(home):
                self.tissue.transfer(home)
                mesh.restore(node)
                self._loose.remove(node)
        self.contact.look()


def _on_raster(point: Vector) -> Vector:
    """Return the nearest point of the raster."""
    found: Vector = np.round(point / RASTER) * RASTER
    return found
