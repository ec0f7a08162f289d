"""One step of a needle in any motion: the equations of tip and shaft, way by way.

The tip presses on the crack front, cuts, or is drawn back on its path. Each of these is a set of
unknowns; in all of them friction is solved for by return mapping, sticking or slipping
(`needle/shaft.py`), against the displacement at the step's start.
"""

import dataclasses
from typing import Protocol

import numpy as np

from needlefem.arrays import Floats, Vector
from needlefem.errors import SimulationError
from needlefem.fem.interpolation import OutsideError, Weights
from needlefem.insertion.result import State
from needlefem.insertion.track import Friction, Track
from needlefem.needle.contact import Contact, Sliding
from needlefem.needle.functionals import Trial
from needlefem.needle.shaft import Shaft

TOLERANCE = 1e-12
"""Distance of the tip from where the needle is at which a step is solved, m."""
STALLED = 1e-15
"""Change of the tip's place, relative to its advance, below which iterating is in vain."""
FLAT = 1e-8
"""Determinant of the place of the tip over its material point that is none."""
MOST_ITERATIONS = 60
MOST_WEAKENINGS = 500
SETTLED = 1e-12
"""Change of friction limits, relative to them, at which weakening has come to rest."""


class Field(Protocol):
    """The tissue's displacement at one time."""

    def means(self, weights: Weights) -> Floats:
        """Return functionals of it in the needle's frame, shape (nrows, dim), m."""
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class Position:
    """A place of the tip in the material, and the equations there.

    Parameters
    ----------
    tip : array, shape (dim,), m
    whole : int
        Number of pieces that the needle fills.
    length : float, m
        Of the piece that the tip is in.
    trial : Trial
    shaft : Shaft
    before : array, shape (whole + 1,), m
        Axial displacement of the pieces, the tip's one among them, at the step's start.
    kinetic : array, shape (whole + 1,), N (N/m in 2D)
        Their friction limits when slipping.
    cutting_force : float, N (N/m in 2D)
    """

    tip: Vector
    whole: int
    length: float
    trial: Trial
    shaft: Shaft
    before: Floats
    kinetic: Floats
    cutting_force: float


@dataclasses.dataclass(frozen=True, eq=False)
class Solution:
    """Forces at a position of the tip for one depth of the needle.

    Parameters
    ----------
    position : Position
    depth : float, m
    forces : array, shape (whole + 2,), N (N/m in 2D)
        Friction of the pieces, then the tip's axial force.
    slip : array, shape (whole + 1,), m
        Of the needle relative to the tissue in this step, forward positive.
    gap : float, m
        From the needle's tip ahead to the material at the tip's position; negative: behind.
    beside : array, shape (dim - 1,), m
        Lateral distance of that material from the axis.
    """

    position: Position
    depth: float
    forces: Floats
    slip: Floats
    gap: float
    beside: Floats

    @property
    def tip_force(self) -> float:
        """Axial force of the tip, N (N/m in 2D)."""
        return float(self.forces[-1])

    @property
    def excess(self) -> float:
        """Force of the tip beyond that of cutting."""
        return self.tip_force - self.position.cutting_force


class StepEquations:
    """Everything that is fixed while one step is solved.

    Parameters
    ----------
    contact : Contact
    track : Track
    friction : Friction
    start : State
        At the step's start.
    field : Field
        The tissue's displacement then.
    """

    def __init__(
        self, contact: Contact, track: Track, friction: Friction, start: State, field: Field
    ) -> None:
        self.contact, self.track, self.friction = contact, track, friction
        self.depth, self._moved, self._field = start.depth, start.moved[: start.whole], field
        self.instrument = track.instrument
        self.evaluations = 0
        self._slidings: dict[int, tuple[Sliding, Floats]] = {}
        self._front: Position | None = None
        self._guess: Floats | None = None

    # positions

    def at_arc(self, arc: float) -> Position:
        """Return the equations with the tip at a length of the path."""
        whole, tip = self.track.at(arc)
        return self.at_point(tip, whole)

    def front(self) -> Position:
        """Return the equations with the tip at the crack front."""
        if self._front is None:
            self._front = self.at_point(self.track.front, self.track.count)
        elif self.contact.covered != self.track.count:
            self.contact.cover(self.track.count)
        return self._front

    def at_point(self, tip: Vector, whole: int) -> Position:
        """Return the equations with the tip at a material point, in the piece after `whole`."""
        self.evaluations += 1
        contact, instrument, axis = self.contact, self.instrument, self.instrument.axis
        if contact.covered != whole:
            contact.cover(whole)
        last = self.track.vertices[whole - 1]
        weights = instrument.tip_and_piece(tip, last)
        trial = contact.try_functionals(weights)
        length = float(np.linalg.norm(tip - last))
        sliding, before = self._sliding(whole)
        offset = axis.offset(0.5 * (tip + last))
        stiffness = instrument.lateral_stiffness * length
        own = self._field.means(Weights(weights.nodes, weights.rows[1:]))[0, 0]
        friction = instrument.friction_at(weights) * length
        return Position(
            tip=tip,
            whole=whole,
            length=length,
            trial=trial,
            shaft=Shaft.build(contact, sliding, trial, offset, stiffness),
            before=np.append(before, own),
            kinetic=np.append(self.track.kinetic[:whole], friction),
            cutting_force=instrument.cutting_force_at(weights),
        )

    def _sliding(self, whole: int) -> tuple[Sliding, Floats]:
        """Return the covered pieces' equations, and their axial displacement at the start."""
        if whole not in self._slidings:
            known = self._moved[:whole, 0]
            fresh = self.contact.pieces[len(known) : whole]
            more = [
                self._field.means(Weights(piece.nodes, piece.weights[None]))[0, 0]
                for piece in fresh
            ]
            self._slidings[whole] = (self.contact.sliding(), np.append(known, more))
        return self._slidings[whole]

    # forces at a position

    def solve(self, position: Position, depth: float, low: float, high: float) -> Solution:
        """Solve for friction, and for the tip's force between bounds; friction may weaken."""
        axis, whole = self.instrument.axis, position.whole
        slipped = self.track.slipped[: whole + 1]
        slack = np.zeros(whole + 2)
        travel = np.append(position.before + (depth - self.depth), 0.0)
        travel[-1] = depth - axis.along(position.tip)
        old = np.append(self.track.pull[: whole + 1], min(max(0.0, low), high))
        if self.friction.stiffness > 0.0:
            slack[:-1] = self._slack(position)
            travel[:-1] += slack[:-1] * old[:-1]
        limits = self.friction.limits(position.kinetic, slipped)
        forces = old if self._guess is None else _resized(self._guess, old)
        for _ in range(MOST_WEAKENINGS):
            bounds = np.append(limits, 0.0)
            bottom, top = -bounds, bounds.copy()
            bottom[-1], top[-1] = low, high
            forces = position.shaft.forces(travel, bottom, top, forces, slack)
            apart = travel - position.shaft.moved(forces) - slack * forces
            slip = np.where(np.abs(forces[:-1]) < limits, 0.0, apart[:-1])
            weaker = self.friction.limits(position.kinetic, slipped + np.abs(slip))
            if np.all(limits - weaker <= SETTLED * limits):
                self._guess = forces
                beside = axis.offset(position.tip) + position.shaft.beside(forces)
                return Solution(position, depth, forces, slip, -float(apart[-1]), beside)
            limits = np.minimum(limits, weaker)
        raise SimulationError("friction does not stop weakening; take shorter steps")

    def _slack(self, position: Position) -> Floats:
        ends = [*self.track.arcs[: position.whole]]
        lengths = np.append(np.diff(ends, prepend=0.0), position.length)
        stiffness = self.friction.stiffness * lengths
        return np.divide(1.0, stiffness, out=np.zeros_like(stiffness), where=stiffness > 0.0)

    # the ways of the tip

    def press(self, depth: float) -> Solution:
        """Return the forces with the tip at the crack front, pressing from nothing to cutting."""
        position = self.front()
        return self.solve(position, depth, 0.0, position.cutting_force)

    def draw(self, depth: float, start: float) -> tuple[float, Solution] | None:
        """Return where on its path a tip without force is, and the forces.

        Parameters
        ----------
        depth : float, m
        start : float, m
            Path length at which it was.

        Returns
        -------
        Path length, m, and solution; None: the tip is beyond the crack front. With a gap at
        length 0 the needle is out.
        """
        last = self.track.length
        low, high = 0.0, last
        arc = min(max(start + depth - self.depth, 0.0), last)
        before: tuple[float, float] | None = None
        for _ in range(MOST_ITERATIONS):
            solution = self.solve(self.at_arc(arc), depth, 0.0, 0.0)
            gap = solution.gap
            if abs(gap) <= TOLERANCE or (gap > 0.0 and arc <= 0.0):
                return arc, solution
            if gap < 0.0 and arc >= last:
                return None
            low, high = (arc, high) if gap < 0.0 else (low, arc)
            slope = 1.0
            if before is not None and before[1] != gap:
                slope = (gap - before[1]) / (arc - before[0])
            before, wanted = (arc, gap), arc - gap / slope if slope > 0.0 else np.nan
            inside = low < wanted < high
            at_end = (wanted <= 0.0 == low) or (wanted >= last == high)
            arc = min(max(wanted, 0.0), last) if inside or at_end else 0.5 * (low + high)
        raise SimulationError(f"no place of the tip found on its path at depth {depth:.4g} m")

    def cut(self, depth: float, ahead: float) -> Solution | None:
        """Return the forces with a tip that has cut on (Broyden's method), or None: not found.

        Parameters
        ----------
        depth : float, m
        ahead : float, m
            How far about.
        """
        axis, front = self.instrument.axis, self.track.front
        tip = front + ahead * axis.direction
        jacobian = np.eye(len(tip))
        solution, error = self._cut_at(tip, depth)
        for _ in range(MOST_ITERATIONS):
            if np.max(np.abs(error)) <= TOLERANCE:
                return solution
            if abs(np.linalg.det(jacobian)) < FLAT:
                return None
            change = -np.linalg.solve(jacobian, error)
            reach, more = float(axis.direction @ (tip - front)), float(axis.direction @ change)
            if reach + more <= 0.0:  # the tip can't go back: go half way towards where it was
                change *= -0.5 * reach / more
            try:
                solution, reached = self._cut_at(tip + change, depth)
            except OutsideError:
                return None
            wrong = reached - error - jacobian @ change
            jacobian = jacobian + np.outer(wrong, change) / (change @ change)
            tip, error = tip + change, reached
            if np.linalg.norm(change) < STALLED * reach:
                return None
        return None

    def cut_to(self, distance: float, depth: float) -> Solution | None:
        """Return the forces with a tip that has cut a distance, at whatever depth, or None.

        Parameters
        ----------
        distance : float, m
            From the crack front.
        depth : float, m
            Guess.
        """
        axis, front = self.instrument.axis, self.track.front
        unknown = np.zeros(len(front))  # depth beyond the guess, then sideways
        jacobian = np.diag([-1.0, *np.ones(len(front) - 1)])
        before: tuple[Floats, Floats] | None = None
        for _ in range(MOST_ITERATIONS):
            sideways = unknown[1:]
            forward = np.sqrt(np.maximum(distance**2 - sideways @ sideways, 0.0))
            tip = front + forward * axis.direction + sideways @ axis.laterals
            position = self.at_point(tip, self.track.count)
            force = position.cutting_force
            solution = self.solve(position, depth + unknown[0], force, force)
            error = np.append(solution.gap, solution.beside)
            if np.max(np.abs(error)) <= TOLERANCE:
                return solution
            if before is not None:
                change = unknown - before[0]
                wrong = error - before[1] - jacobian @ change
                jacobian = jacobian + np.outer(wrong, change) / (change @ change)
            before = (unknown, error)
            if abs(np.linalg.det(jacobian)) < FLAT:
                return None
            unknown = unknown - np.linalg.solve(jacobian, error)
            if np.linalg.norm(unknown[1:]) >= distance or np.array_equal(unknown, before[0]):
                return None
        return None

    def _cut_at(self, tip: Vector, depth: float) -> tuple[Solution, Floats]:
        position = self.at_point(tip, self.track.count)
        force = position.cutting_force
        solution = self.solve(position, depth, force, force)
        error = np.append(solution.gap, solution.beside) @ self.instrument.axis.frame
        return solution, error

    def run_ahead(self, distance: float, depth: float) -> Solution:
        """Return the forces, whatever the tip's is, with a tip that ran ahead of the crack front.

        Parameters
        ----------
        distance : float, m
            From the crack front.
        depth : float, m
        """
        axis, front = self.instrument.axis, self.track.front
        sideways, slope = np.zeros(len(axis.laterals)), np.eye(len(axis.laterals))
        before: tuple[Floats, Floats] | None = None
        for _ in range(MOST_ITERATIONS):
            forward = np.sqrt(distance**2 - sideways @ sideways)
            tip = front + forward * axis.direction + sideways @ axis.laterals
            solution = self.solve(self.at_point(tip, self.track.count), depth, -np.inf, np.inf)
            beside = solution.beside
            if np.max(np.abs(beside)) <= TOLERANCE:
                return solution
            if before is not None:
                change = sideways - before[0]
                wrong = beside - before[1] - slope @ change
                slope = slope + np.outer(wrong, change) / (change @ change)
            before = (sideways, beside)
            sideways = sideways - np.linalg.solve(slope, beside)
            sideways *= min(1.0, 0.9 * distance / max(float(np.linalg.norm(sideways)), 1e-300))
            if np.array_equal(sideways, before[0]):
                break
        raise SimulationError(f"no equilibrium found {distance:.3g} m ahead of {front} m")


def _resized(guess: Floats, like: Floats) -> Floats:
    """Return forces for as many pieces as there are now; those of the tip's piece stay last."""
    found = like.copy()
    count = min(len(guess), len(like)) - 2
    found[:count], found[-2:] = guess[:count], guess[-2:]
    return found
