"""The equations of shaft and tip in one step of any motion, and the iterations that solve them.

The tip loads the crack front, cuts, or is retracted (`insertion/tip_advance.py`). In each of these
phases friction is solved for by return mapping, with sticking and slipping segments
(`contact/friction.py`), relative to the displacement at the start of the step.
"""

import dataclasses
from collections.abc import Callable
from typing import Protocol

import numpy as np
import scipy  # its module of root finding is imported when it is first used

from needlefem._arrays import Floats, Vector
from needlefem.contact.condensed_contact import (
    AxialCompliance,
    CondensedContact,
    ContactTrial,
    ShaftEquations,
)
from needlefem.contact.friction import FrictionStep, SlipWeakeningFriction
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.insertion.cut_path import CutPath
from needlefem.insertion.state import State

TOLERANCE = 1e-12
"""Distance of the tip from where the needle is at which a step is solved, m."""


class Field(Protocol):
    """The tissue's displacement at one time."""

    def means(self, weights: LinearFunctionals) -> Floats:
        """Return functionals of it in the needle's frame, shape (nrows, dim), m."""
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class TipPosition:
    """A place of the tip in the material, and the equations there.

    Parameters
    ----------
    tip : array, shape (dim,), m
    whole : int
        Number of pieces that the needle fills.
    length : float, m
        Of the piece that the tip is in.
    trial : ContactTrial
    shaft : ShaftEquations
    before : array, shape (whole + 1,), m
        Axial displacement of the pieces, the tip's one among them, at the step's start.
    kinetic : array, shape (whole + 1,), N (N/m in 2D)
        Their friction limits when slipping.
    cutting_force : float, N (N/m in 2D)
    """

    tip: Vector
    full_segments: int
    length: float
    trial: ContactTrial
    shaft: ShaftEquations
    before: Floats
    kinetic: Floats
    cutting_force: float


@dataclasses.dataclass(frozen=True, eq=False)
class StepSolution:
    """Forces at a position of the tip for one depth of the needle.

    Parameters
    ----------
    position : TipPosition
    depth : float, m
    forces : array, shape (whole + 2,), N (N/m in 2D)
        Friction of the pieces, then the tip's axial force.
    slip : array, shape (whole + 1,), m
        Of the needle relative to the tissue in this step, forward positive.
    slipped : array, shape (whole + 1,), m
        Since sticking, at the step's end.
    gap : float, m
        From the needle's tip ahead to the material at the tip's position; negative: behind.
    beside : array, shape (dim - 1,), m
        Lateral distance of that material from the axis.
    """

    position: TipPosition
    depth: float
    forces: Floats
    slip: Floats
    slipped: Floats
    axial_gap: float
    lateral_gap: Floats

    @property
    def tip_force(self) -> float:
        """Axial force of the tip, N (N/m in 2D)."""
        return float(self.forces[-1])

    @property
    def excess_cutting_force(self) -> float:
        """Force of the tip beyond that of cutting."""
        return self.tip_force - self.position.cutting_force


class StepEquations:
    """Everything that is fixed while one step is solved.

    Parameters
    ----------
    contact : CondensedContact
    track : CutPath
    friction : SlipWeakeningFriction
    start : State
        At the step's start.
    field : Field
        The tissue's displacement then.
    """

    def __init__(
        self,
        contact: CondensedContact,
        track: CutPath,
        friction: SlipWeakeningFriction,
        start: State,
        field: Field,
    ) -> None:
        self.contact, self.track, self.friction = contact, track, friction
        self.depth, self._moved, self._field = (
            start.depth,
            start.segment_displacement[: start.full_segments],
            field,
        )
        self.instrument = track.instrument
        self.evaluations = 0
        self._slidings: dict[int, tuple[AxialCompliance, Floats]] = {}
        self._front: TipPosition | None = None
        self._guess: Floats | None = None
        self._partly = (
            None
            if start.partial_segment is None
            else (start.full_segments, start.partial_segment.compliance)
        )
        self._slid = np.zeros(0) if start.slipping is None else start.slipping
        self._same = same = start.full_segments
        if (
            same < min(track.count, len(start.friction_force))
            and track.arcs[same] <= start.inserted_length
        ):
            self._same += 1  # the piece that grew is whole

    # positions

    def at_arc(self, arc: float) -> TipPosition:
        """Return the equations with the tip at a length of the path."""
        whole, tip = self.track.at(arc)
        return self.at_point(tip, whole)

    def front(self) -> TipPosition:
        """Return the equations with the tip at the crack front."""
        if self._front is None:
            self._front = self.at_point(self.track.crack_front, self.track.count)
        elif self.contact.active_segments != self.track.count:
            self.contact.set_active(self.track.count)
        return self._front

    def at_point(self, tip: Vector, whole: int) -> TipPosition:
        """Return the equations with the tip at a material point, in the piece after `whole`."""
        self.evaluations += 1
        contact, instrument, axis = self.contact, self.instrument, self.instrument.axis
        if contact.active_segments != whole:
            contact.set_active(whole)
        last = self.track.vertices[whole - 1]
        weights = instrument.tip_and_piece(tip, last)
        trial = contact.trial(weights)
        length = float(np.linalg.norm(tip - last))
        sliding, before = self._sliding(whole)
        offset = axis.lateral_offset(0.5 * (tip + last))
        stiffness = instrument.lateral_penalty * length
        own = self._field.means(LinearFunctionals(weights.nodes, weights.rows[1:]))[0, 0]
        friction = instrument.friction_at(weights) * length
        return TipPosition(
            tip=tip,
            full_segments=whole,
            length=length,
            trial=trial,
            shaft=ShaftEquations.build(contact, sliding, trial, offset, stiffness),
            before=np.append(before, own),
            kinetic=np.append(self.track.kinetic[:whole], friction),
            cutting_force=instrument.cutting_force_at(weights),
        )

    def _sliding(self, whole: int) -> tuple[AxialCompliance, Floats]:
        """Return the covered pieces' equations, and their axial displacement at the start."""
        if whole not in self._slidings:
            known = self._moved[:whole, 0]
            fresh = self.contact.pieces[len(known) : whole]
            more = [
                self._field.means(LinearFunctionals(piece.nodes, piece.weights[None]))[0, 0]
                for piece in fresh
            ]
            self._slidings[whole] = (self.contact.sliding(), np.append(known, more))
        return self._slidings[whole]

    def _lag(self, whole: int, travel: float) -> Floats | None:
        """Return how far what slid stays behind the needle if it sticks; None without inertia.

        Of whole pieces that carried force before as well; the others stick by displacement. As
        far as it is inertia that holds a piece, it goes half the needle's way and half its own,
        by the measure that is less behind.
        """
        swing, same = self.contact.swing, min(whole, self._same)
        if swing is None:
            return None
        slid, found = self._slid[:same], np.zeros(whole + 1)
        late = np.min(slid * (0.5 * travel - swing[:2, :same]), axis=0)
        held = np.diagonal(self._slidings[whole][0].compliance)[:same]
        share = np.minimum(held / swing[2, :same], 1.0)
        found[:same] = share * slid * np.maximum(late, 0.0)
        return found

    def _kept(self, position: TipPosition) -> Floats:
        """Return the friction forces at the step's start on what the needle still lies in then.

        Sticking that gives way is stretched by the force per length, which stays as it was where
        the tip is drawn back in a piece; material that it cuts anew carries none.
        """
        whole, track = position.full_segments, self.track
        found = track.friction_force[: whole + 1]
        if self.friction.stiffness > 0.0:
            length = track.arcs[whole] - track.arcs[whole - 1] if whole < track.count else 0.0
            if self._partly is not None and self._partly[0] == whole:
                length = 1.0 / (self.instrument.lateral_penalty * self._partly[1])
            if position.length < length:
                found = found.copy()
                found[-1] *= position.length / length
        return found

    # forces at a position

    def solve(self, position: TipPosition, depth: float, low: float, high: float) -> StepSolution:
        """Solve for friction, and for the tip's force between bounds."""
        axis, whole, track = self.instrument.axis, position.full_segments, self.track
        ends = np.diff(track.arcs[:whole], prepend=0.0)
        rub = FrictionStep(
            friction=self.friction,
            kinetic=position.kinetic,
            slipped=track.slip_since_stick[: whole + 1],
            travel=position.before + (depth - self.depth),
            old=self._kept(position),
            lengths=np.append(ends, position.length),
            lag=self._lag(whole, depth - self.depth),
        )
        start = np.append(rub.old, min(max(0.0, low), high))
        if self._guess is not None:
            start = _resized(self._guess, start)
        shaft, tip = position.shaft, (low, high, depth - float(axis.axial_coordinate(position.tip)))
        forces, slip, apart = rub.solve(shaft.compliance, shaft.free, start, tip)
        self._guess = forces
        beside = axis.lateral_offset(position.tip) + shaft.lateral_tip_displacement(forces)
        gap = -float(apart[-1])
        return StepSolution(position, depth, forces, slip, rub.after(slip), gap, beside)


def _resized(guess: Floats, like: Floats) -> Floats:
    """Return forces for as many pieces as there are now; those of the tip's piece stay last."""
    found = like.copy()
    count = min(len(guess), len(like)) - 2
    found[:count], found[-2:] = guess[:count], guess[-2:]
    return found


# Roots: Broyden's method for the place of the tip, Brent's for one unknown in an interval.


SMALLEST_CHANGE = 1e-15
"""Change of the unknowns below which iterating is in vain, m."""
FLAT = 1e-8
"""Determinant of the errors' derivatives that is none."""
MOST_BROYDEN_ITERATIONS = 60

Evaluate = Callable[[Floats], tuple[StepSolution, Floats]]
Limit = Callable[[Floats, Floats], Floats]


def broyden(
    evaluate: Evaluate, unknown: Floats, jacobian: Floats, limit: Limit
) -> StepSolution | None:
    """Return the solution without an error (C. G. Broyden 1965), or None: not found.

    Parameters
    ----------
    evaluate : callable
        Takes unknowns, shape (n,), m; returns solution and errors, shape (n,), m.
    unknown : array, shape (n,), m
        Guess.
    jacobian : array, shape (n, n)
        Of the errors, about.
    limit : callable
        Takes unknowns and their change; returns the change that is allowed.
    """
    jacobian, (solution, error) = jacobian.copy(), evaluate(unknown)
    for _ in range(MOST_BROYDEN_ITERATIONS):
        if np.max(np.abs(error)) <= TOLERANCE:
            return solution
        if abs(np.linalg.det(jacobian)) < FLAT:
            return None
        newton: Floats = -np.linalg.solve(jacobian, error).astype(float)
        change = limit(unknown, newton)
        if np.linalg.norm(change) < SMALLEST_CHANGE:
            return None
        solution, reached = evaluate(unknown + change)
        wrong = reached - error - jacobian @ change
        jacobian += np.outer(wrong, change) / (change @ change)
        unknown, error = unknown + change, reached
    return None


def root_between(function: Callable[[float], float], low: float, high: float, xtol: float) -> float:
    """Return where a function that changes sign between `low` and `high` vanishes (R. P. Brent).

    scipy wraps what it is given in a function that refers to itself. It is given `_value`, so
    that it does not keep `function`, and the tissue in it, until the next garbage collection.
    """
    return float(scipy.optimize.brentq(_value, low, high, args=(function,), xtol=xtol))


def _value(unknown: float, function: Callable[[float], float]) -> float:
    return function(unknown)
