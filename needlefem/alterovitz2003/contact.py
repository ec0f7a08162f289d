"""Contact of the method of 2003: an active-set method, and the forces on nodes of the needle.

Each row is a functional of the displacement with a force on it. While the force is within its
limits, the displacement has its target value (the row is active). At a limit the force is constant
and the displacement is free in the direction of the force. Shaft nodes that stick or slide, a tip
that loads or cuts, and constraints without limits are described in this way.
"""

import dataclasses

import numpy as np
from scipy.linalg.lapack import dposv

from needlefem._arrays import Bools, Floats, Ints, Vector
from needlefem.alterovitz2003.moving_tissue import MovingTissue, Response
from needlefem.alterovitz2003.node_chain import NeedleFunctionals, NodeChain
from needlefem.errors import SimulationError
from needlefem.insertion.state import State, TipPhase

TIE = 1e-12
"""Relative margin by which a force must exceed its limit, or a displacement its target; within it
the state of the row does not change, so that round-off has no influence."""
FREELY, MOST_ROUNDS = 10, 60
"""Rounds after which a released row is not activated again; largest number of rounds."""


@dataclasses.dataclass(frozen=True, eq=False)
class ForceLimits:
    """Limits of the forces.

    Parameters
    ----------
    low, high : arrays, shape (n,), N (N/m in 2D)
        Equal limits prescribe a force; with infinite limits the row is always active.
    grip : float
        Ratio of the limits of an active row to those of a released row (static over kinetic).
    """

    low: Floats
    high: Floats
    grip: float = 1.0


@dataclasses.dataclass(frozen=True, eq=False)
class ActiveSetSolution:
    """Forces, displacements, and whether rows are active; arrays of shape (n,)."""

    forces: Floats
    moved: Floats
    held: Bools


def solve_active_set(
    compliance: Floats, free: Floats, target: Floats, limits: ForceLimits, before: ActiveSetSolution
) -> ActiveSetSolution:
    """Return forces and displacements that satisfy targets and limits.

    The active-set iteration starts with the rows that were active before.

    Parameters
    ----------
    compliance : array, shape (n, n), m/N
        Symmetric, positive definite.
    free : array, shape (n,), m
        Displacements without the forces.
    target : array, shape (n,), m
    limits : ForceLimits
    before : ActiveSetSolution
        Rows that are active at first; the signs of forces select the limits of the others.

    Raises
    ------
    SimulationError
        The iteration did not converge.
    """
    may = limits.low < limits.high
    held = may & (before.held | np.isinf(limits.high))
    forces = np.where(before.forces >= 0.0, limits.high, limits.low)
    forces[held] = 0.0
    for number in range(MOST_ROUNDS):
        loose = np.where(held, 0.0, forces)
        rest = target - free - compliance @ loose
        forces = loose
        rows = np.flatnonzero(held)
        if rows.size:
            _, solved, singular = dposv(compliance[rows[:, None], rows], rest[rows])
            if singular:
                raise SimulationError("two nodes on the needle have the same material point")
            forces[rows] = solved
        moved = free + compliance @ forces
        margin = TIE * float(np.abs(forces).max(initial=0.0))
        over = held & (forces > limits.grip * limits.high + margin)
        under = held & (forces < limits.grip * limits.low - margin)
        back = may & ~held & _against(forces, moved - target, limits, free)
        if number >= FREELY:
            back[:] = False
        if not (over.any() or under.any() or back.any()):
            return ActiveSetSolution(forces, moved, held)
        forces[over], forces[under] = limits.high[over], limits.low[under]
        held = (held & ~over & ~under) | back
    raise SimulationError("the active set of sticking and sliding nodes did not converge")


def _against(forces: Floats, beyond: Floats, limits: ForceLimits, free: Floats) -> Bools:
    """Return which rows at a limit would move against their force."""
    margin = TIE * float(np.abs(free).max(initial=0.0) + np.abs(beyond).max(initial=0.0))
    return np.where(forces >= limits.high, beyond > margin, beyond < -margin)


# Contact of a needle with the nodes on it in one time step.


@dataclasses.dataclass(frozen=True, eq=False)
class Memory:
    """Initial values of a step: forces, active set, and axial displacements of the shaft."""

    settled: ActiveSetSolution
    before: Floats


class NodeContact:
    """Forces between needle and nodes.

    The rows are ordered: axial displacements of the shaft nodes, lateral displacements of the shaft
    nodes, axial and lateral displacement of the tip.

    Parameters
    ----------
    tissue : MovingTissue
    chain : NodeChain
    touch : NeedleFunctionals
    grip : float
        Ratio of static to kinetic friction.

    Attributes
    ----------
    evaluations : int
    """

    def __init__(
        self, tissue: MovingTissue, chain: NodeChain, touch: NeedleFunctionals, grip: float
    ) -> None:
        self._tissue, self._chain, self._touch, self._grip = tissue, chain, touch, grip
        self.evaluations = 0
        self.memory = Memory(
            ActiveSetSolution(np.zeros(2), np.zeros(2), np.ones(2, dtype=bool)), np.zeros(0)
        )
        self.look()

    def look(self) -> None:
        """Update the needle's functionals after nodes were moved."""
        chain = self._chain
        shaft, near = self._touch.look(chain.tip_node, chain.tip, chain.nodes)
        self._tissue.freeze(chain.tip_node, shaft, near)
        before = self._tissue.moved(shaft) @ self._tissue.frame[0]
        self.memory = dataclasses.replace(self.memory, before=before)
        self._friction = self._touch.friction(chain.mesh.points[chain.nodes])

    def take_on(self) -> None:
        """Add a node to the shaft; it slides at first."""
        count, last = len(self._chain.shaft) - 1, self.memory.settled
        rows = [count, 2 * count]
        settled = ActiveSetSolution(
            np.insert(last.forces, rows, [1.0, 0.0]),
            np.insert(last.moved, rows, 0.0),
            np.insert(last.held, rows, [False, True]),
        )
        self.memory = dataclasses.replace(self.memory, settled=settled)

    def keep(self, kept: int) -> None:
        """Keep the first nodes of the shaft only."""
        last = self.memory.settled
        count = len(last.forces) // 2 - 1
        rows: Ints = np.r_[:kept, count : count + kept, 2 * count : 2 * count + 2]
        settled = ActiveSetSolution(last.forces[rows], last.moved[rows], last.held[rows])
        self.memory = dataclasses.replace(self.memory, settled=settled)

    def evaluate(
        self, point: Vector, depth: float, travel: float, way: TipPhase, *, endless: bool = False
    ) -> tuple[Response, ActiveSetSolution]:
        """Return the tissue's response and the forces for a position of the tip node.

        A loading tip has a prescribed position up to the cutting force (or up to `endless`). A
        cutting tip has the cutting force, and a share of the lateral force on the last shaft node
        that corresponds to its own share of the path. A retracted tip has no force.

        Parameters
        ----------
        point : array, shape (2,), m
        depth, travel : float, m
            Depth at the end of the step, and travel during the step.
        way : TipPhase
        """
        self.evaluations += 1
        chain, axis = self._chain, self._chain.axis
        response = self._tissue.respond(point, self._touch.tip(chain.tip_node, point))
        shares = chain.shares(None if way is TipPhase.RETRACTED else point)
        limits = self._limits(point, shares, way, endless=endless)
        where = np.vstack([chain.mesh.points[chain.nodes], point])
        offset, ahead = (
            axis.lateral_offset(where)[:, 0],
            depth - float(axis.axial_coordinate(point)),
        )
        with_needle = self.memory.before + travel
        target = np.concatenate([with_needle, -offset[:-1], [ahead, -offset[-1]]])
        matrix, free = response.compliance, response.free
        share = shares[-1] / shares[-2] if way is TipPhase.CUTTING else 0.0
        if share:  # the lateral force on the last node acts on both
            matrix, free = matrix.copy(), free.copy()
            matrix[-3] += share * matrix[-1]
            matrix[:, -3] += share * matrix[:, -1]
            free[-3] += share * free[-1]
            target[-3] += share * target[-1]
        found = solve_active_set(matrix, free, target, limits, self.memory.settled)
        if not share:
            return response, found
        forces = found.forces.copy()
        forces[-1] = share * forces[-3]
        moved = response.free + response.compliance @ forces
        return response, ActiveSetSolution(forces, moved, found.held)

    def _limits(
        self, point: Vector, shares: Floats, way: TipPhase, *, endless: bool
    ) -> ForceLimits:
        friction = shares * np.append(self._friction, self._touch.friction(point[None]))
        push = np.inf if endless else self._touch.cutting_force(point) + friction[-1]
        count = len(friction) - 1
        high = np.full(2 * count + 2, np.inf)
        high[:count], high[-2] = friction[:-1], push
        low = -high
        low[-2] = -friction[-1]
        if way is TipPhase.RETRACTED:
            low[-2:] = high[-2:] = 0.0
        elif way is TipPhase.CUTTING:
            low[-2:] = high[-2:] = [push, 0.0]
        return ForceLimits(low, high, self._grip)

    def finish(self, response: Response, settled: ActiveSetSolution) -> None:
        """Finish the step with the resulting forces."""
        self._tissue.finish(response, settled.forces)
        self.memory = Memory(settled, settled.moved[: len(self._chain.shaft)])

    def state(self, depth: float, time: float, way: TipPhase) -> State:
        """Return the present state; the last axial force is the friction at the tip."""
        chain, settled = self._chain, self.memory.settled
        count, forces, moved = len(chain.shaft), settled.forces, settled.moved
        limit, share = self._touch.cutting_force(chain.tip), 0.0
        if way is not TipPhase.RETRACTED:
            share = float(self._touch.friction(chain.tip[None])[0] * chain.shares(chain.tip)[-1])
        force = float(forces[-2]) * limit / (limit + share)
        weights = self._touch.tip(chain.tip_node, chain.mesh.points[chain.tip_node])
        on_path = count + 1 if count else 0
        return State(
            depth=depth,
            tip=chain.tip,
            tip_force=force,
            cutting_force=limit,
            tip_lateral=forces[-1:],
            tip_nodes=weights.nodes,
            tip_weights=weights.rows[0],
            friction_force=np.append(forces[:count], forces[-2] - force)[:on_path],
            lateral_force=np.append(forces[count:-2], 0.0)[:on_path, None],
            segment_displacement=np.column_stack(
                [np.append(moved[:count], moved[-2]), np.append(moved[count:-2], moved[-1])]
            )[:on_path],
            time=time,
            inserted_length=chain.lengths[-1],
            tip_phase=way,
            tip_displacement=float(moved[-2]),
        )
