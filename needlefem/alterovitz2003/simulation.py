"""A scene made ready for insertions by the paper's method: nodes on the needle, in time."""

import dataclasses
from collections.abc import Iterable, Iterator
from functools import cached_property

import numpy as np

from needlefem._arrays import Vector
from needlefem.alterovitz2003.contact import ActiveSetSolution, NodeContact
from needlefem.alterovitz2003.moving_tissue import MovingTissue, Response, TissueInTime
from needlefem.alterovitz2003.node_chain import (
    LEAST_AREA,
    NeedleFunctionals,
    NodeChain,
    NoNodeError,
)
from needlefem.dynamics import Damping, KinematicState, Newmark
from needlefem.errors import SimulationError
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.result import Insertion, Outcome, Status
from needlefem.insertion.simulation import Simulation, Stop, Watch
from needlefem.insertion.state import State, TipPhase
from needlefem.mesh.surface import Entry
from needlefem.needle.needle_interface import NeedleInterface
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
                grip=self.scene.needle.static_friction_ratio,
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
            ruptures=(),
            contact_solves=pushed.contact.evaluations,
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


# An insertion with nodes of the mesh on the needle, stepped in time.
#
# The coupling of R. Alterovitz et al., IROS 2003, section IV: a node at the tip, those left behind
# on the shaft, attached or sliding. The tip holds its material point until its force is that of
# cutting; then its node is moved ahead in the reference until it is where the needle is under the
# cutting force. Drawn back, the needle lets go of one node after the other, and they return home.


TOLERANCE = 1e-6
"""Distance of the tip from where the needle is at which a step is solved, m.

A hundredth of the tolerance of the paper's search.
"""
RASTER = 1e-8
"""Places of the tip's node are multiples of this, m: a hundredth of the tolerance.

Round-off of the tissue's response, some 1e-14 m, differs between processors and libraries. A step
that is hard to solve enlarges it until another node is moved, and the tip ends a fraction of a
millimetre elsewhere. Rounded, the places and with them the moved mesh are the same everywhere.
"""
MOST_ITERATIONS, MOST_HALVINGS = 20, 10
SLOPES = (0.2, 1.5)
"""Least and most way of the tip per travel of the needle that is expected of a step."""
REACHES = (1.0, 4.0, 16.0)
"""How much further ahead the tip is looked for where it is not found: it may have snapped."""
LEAST_TRAVEL = 1e-6
"""Travel, m, over which a tip is looked for ahead when the needle rests."""
FORWARD = 1e-9
"""Least way that a cutting tip makes in a step, m; below it holds."""

Found = tuple[Vector, Response, ActiveSetSolution]


class ConformingInsertion:
    """A needle that nodes of the mesh follow.

    Parameters
    ----------
    instrument : NeedleInterface
    tissue : TissueInTime
    spread : bool
        Whether forces are spread over the instrument's kernel and section; else each acts on its
        node alone, as in the paper.
    grip : float
        Static over kinetic friction.

    Attributes
    ----------
    outcome : Outcome
        How `iterate` ended.
    waited : int
        Steps in which a tip that would cut found no place to go, and held.
    steps : int
        Time steps so far.
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
        self._slope = 0.5 * self.axis.direction  # way of the tip per travel of the needle
        self._jacobian = np.eye(2)

    def iterate(self, depths: Iterable[float]) -> Iterator[State]:
        """Yield the state at every depth; one time step leads from each to the next."""
        try:
            for depth in depths:
                yield self.advance(float(depth))
            self.outcome = Outcome(Status.COMPLETED, f"reached {self.depth:.4g} m")
        except NoNodeError as error:
            self.outcome = Outcome(Status.NO_NODE, str(error))
        except SimulationError as error:
            self.outcome = Outcome(Status.NOT_CONVERGED, str(error))

    def advance(self, depth: float) -> State:
        """Make a time step that ends at a depth.

        Raises
        ------
        NoNodeError
            No node could follow the tip over more than the distance to the next ones.
        SimulationError
            No equilibrium was found, or a needle that was drawn back is pushed in again.
        """
        travel = depth - self.depth
        if travel < 0.0:
            self._way = TipPhase.RETRACTED
        if self._way is TipPhase.RETRACTED:
            if travel > 0.0:
                raise SimulationError("a needle that was drawn back can't be pushed in again")
            self._withdraw(depth)
        elif not (self._way is TipPhase.CUTTING and travel > 0.0 and self._cut(depth)):
            self._hold(depth)
        self.depth = depth
        self.steps += 1
        return self.contact.state(depth, self.steps * self.tissue.shared.stepper.step, self._way)

    def _hold(self, depth: float) -> None:
        """Let the tip hold its point, or begin to cut if its force is that of cutting."""
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
        """Move the tip's node ahead to where the needle is; say whether it went ahead."""
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
                    if not other and travel > LEAST_TRAVEL:  # else the path has a kink
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
        """Bring the nearest node ahead of the tip, and find its place; say if it is another."""
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
        """End the step with the tip's node in its place."""
        point, response, settled = found
        self.chain.mesh.place(self.chain.tip_node, point)
        self.chain.record(point)
        self._waiting, self._way = 0.0, TipPhase.CUTTING
        self.contact.finish(response, settled)

    def _expected(self, slope: Vector) -> Vector:
        """Return what to expect of the next step, mostly straight ahead, after one step's slope."""
        ahead = min(max(float(slope @ self.axis.direction), SLOPES[0]), SLOPES[1])
        sideways = float(self.axis.lateral_directions[0] @ slope)
        sideways = min(max(sideways, -SLOPES[0] * ahead), SLOPES[0] * ahead)
        expected: Vector = np.array([ahead, sideways]) @ self.axis.frame
        return expected

    def _wait(self, travel: float, error: Exception) -> None:
        """Hold for want of a place, over no more than the way to the next nodes."""
        self._waiting += travel
        self.waited += 1
        if self._waiting > self.touch.size(self.chain.tip_node):
            raise error

    def _solve(self, point: Vector, depth: float) -> Found:
        """Find the place of the tip's node by Broyden's method, in the order of the axes."""
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
            error = self._off(point, settled, depth) - residual - self._jacobian @ change
            self._jacobian = self._jacobian + np.outer(error, change) / (change @ change)
        self._jacobian = np.eye(2)
        raise SimulationError(f"no place of the tip was found at depth {depth:.4g} m")

    def _allowed(self, point: Vector, change: Vector) -> Vector:
        """Return a change, halved until no cell turns over."""
        for _ in range(MOST_HALVINGS):
            if self.tissue.ratio(point + change) >= 0.5 * LEAST_AREA:
                return change
            change = 0.5 * change
        raise NoNodeError("the node at the tip can't follow it: a cell would turn over")

    def _off(self, point: Vector, settled: ActiveSetSolution, depth: float) -> Vector:
        """Return how far the tip is from where the needle is, shape (2,), m."""
        off: Vector = point + settled.moved[-2:] @ self.axis.frame - self.axis.tip_position(depth)
        return off

    def _withdraw(self, depth: float) -> None:
        """Draw the needle back; nodes that it leaves go home once no cell turns over by that."""
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
    """Return the nearest place on the raster."""
    found: Vector = np.round(point / RASTER) * RASTER
    return found
