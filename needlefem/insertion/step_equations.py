"""The equations of shaft and tip in one step of any motion, and the iterations that solve them.

The tip loads the crack front, cuts, or is retracted (`insertion/tip_advance.py`). In each of these
phases friction is solved for by return mapping, with sticking and slipping segments
(`contact/friction.py`), relative to the displacement at the start of the step.
"""

import dataclasses
from typing import Protocol

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.contact.condensed_contact import (
    AxialCompliance,
    CondensedContact,
    ContactTrial,
    ShaftEquations,
)
from needlefem.contact.friction import STUCK, FrictionStep, SlipWeakeningFriction
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.insertion.cut_path import CutPath
from needlefem.insertion.state import State
from needlefem.insertion.tip_solver import TipSolution

SAME_LIMIT = 1e-12
"""Relative difference of the friction limit from its kinetic value that is round-off."""
TOLERANCE = 1e-12
"""Tolerance of the distance between the material point at the tip and the tip in space, m."""


class Field(Protocol):
    """The displacement field of the tissue in one state."""

    def means(self, weights: LinearFunctionals) -> Floats:
        """Return linear functionals of the field in the needle's frame, shape (nrows, dim), m."""
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class TipPosition:
    """A material point at the tip, with the functionals and the resistance there.

    Parameters
    ----------
    tip : array, shape (dim,), m
        Material point at the tip.
    full_segments : int
        Number of contact segments that the needle fills completely.
    length : float, m
        Length of the partial segment, in which the tip is.
    trial : ContactTrial
        Tip kernel and partial segment.
    kinetic : array, shape (full_segments + 1,), N (N/m in 2D)
        Kinetic friction force of the segments.
    cutting_force : float, N (N/m in 2D)
    """

    tip: Vector
    full_segments: int
    length: float
    trial: ContactTrial
    kinetic: Floats
    cutting_force: float


@dataclasses.dataclass(frozen=True, eq=False)
class ContactPosition(TipPosition):
    """A material point at the tip, and the contact equations for it.

    Parameters
    ----------
    shaft : ShaftEquations
    before : array, shape (full_segments + 1,), m
        Axial displacement of the segments, including the partial one, at the start of the step.
    """

    shaft: ShaftEquations
    before: Floats


@dataclasses.dataclass(frozen=True, eq=False)
class StepSolution:
    """Forces for a material point at the tip and a depth of the needle.

    Parameters
    ----------
    position : TipPosition
    depth : float, m
    forces : array, shape (full_segments + 2,), N (N/m in 2D)
        Friction forces of the segments, then the axial tip force.
    lateral : array, shape (dim - 1,), N (N/m in 2D)
        Lateral force on the partial segment.
    slip : array, shape (full_segments + 1,), m
        Slip of the needle relative to the segments in this step, positive forward.
    slipped : array, shape (full_segments + 1,), m
        Slip since the segment last stuck, at the end of the step.
    axial_gap : float, m
        Axial position of the material point minus that of the tip; positive: it is ahead.
    lateral_gap : array, shape (dim - 1,), m
        Lateral distance of the material point from the axis.
    """

    position: TipPosition
    depth: float
    forces: Floats
    lateral: Floats
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
        """Tip force minus cutting force, N (N/m in 2D)."""
        return self.tip_force - self.position.cutting_force


class StepEquations:
    """The equations of one step; the data of its start are fixed while they are solved.

    Parameters
    ----------
    contact : CondensedContact
    cut_path : CutPath
    friction : SlipWeakeningFriction
    start : State
        State at the start of the step.
    field : Field
        Displacement field at the start of the step.
    """

    def __init__(
        self,
        contact: CondensedContact,
        cut_path: CutPath,
        friction: SlipWeakeningFriction,
        start: State,
        field: Field,
    ) -> None:
        self.contact, self.cut_path, self.friction = contact, cut_path, friction
        self.depth, self._initial_displacement, self._field = (
            start.depth,
            start.segment_displacement[: start.full_segments],
            field,
        )
        self.instrument = cut_path.instrument
        self.evaluations = 0
        self._slidings: dict[int, tuple[AxialCompliance, Floats]] = {}
        self._front: ContactPosition | None = None
        self._guess: Floats | None = None
        self._initial_partial = (
            None
            if start.partial_segment is None
            else (start.full_segments, start.partial_segment.compliance)
        )
        self._initial_slip_direction = np.zeros(0) if start.slipping is None else start.slipping
        self._common_segments = same = start.full_segments
        if (
            same < min(cut_path.count, len(start.friction_force))
            and cut_path.arcs[same] <= start.inserted_length
        ):
            self._common_segments += 1  # the growing segment is full now

    # equations for a position of the tip

    def at_arc(self, arc: float) -> ContactPosition:
        """Return the equations with the tip at a path length."""
        full_segments, tip = self.cut_path.at(arc)
        return self.at_point(tip, full_segments)

    def front(self) -> ContactPosition:
        """Return the equations with the tip at the crack front."""
        if self._front is None:
            self._front = self.at_point(self.cut_path.crack_front, self.cut_path.count)
        elif self.contact.active_segments != self.cut_path.count:
            self.contact.set_active(self.cut_path.count)
        return self._front

    def at_point(self, tip: Vector, full_segments: int) -> ContactPosition:
        """Return the equations with the tip at a material point after the full segments."""
        self.evaluations += 1
        contact, instrument, axis = self.contact, self.instrument, self.instrument.axis
        if contact.active_segments != full_segments:
            contact.set_active(full_segments)
        last = self.cut_path.vertices[full_segments - 1]
        weights = instrument.tip_and_segment(tip, last)
        trial = contact.trial(weights)
        length = float(np.linalg.norm(tip - last))
        sliding, before = self._sliding(full_segments)
        offset = axis.lateral_offset(0.5 * (tip + last))
        stiffness = instrument.lateral_penalty * length
        own = self._field.means(LinearFunctionals(weights.nodes, weights.rows[1:]))[0, 0]
        friction = instrument.friction_at(weights) * length
        return ContactPosition(
            tip=tip,
            full_segments=full_segments,
            length=length,
            trial=trial,
            shaft=ShaftEquations.build(contact, sliding, trial, offset, stiffness),
            before=np.append(before, own),
            kinetic=np.append(self.cut_path.kinetic[:full_segments], friction),
            cutting_force=instrument.cutting_force_at(weights),
        )

    def _sliding(self, count: int) -> tuple[AxialCompliance, Floats]:
        """Return the axial compliance of the first segments, and their initial displacement, m."""
        if count not in self._slidings:
            self._slidings[count] = (self.contact.sliding(), self._before(count))
        return self._slidings[count]

    def _before(self, count: int) -> Floats:
        """Return the axial displacement of the first segments at the start of the step, m."""
        known = self._initial_displacement[:count, 0]
        more = [
            self._field.means(LinearFunctionals(segment.nodes, segment.weights[None]))[0, 0]
            for segment in self.contact.segments[len(known) : count]
        ]
        return np.append(known, more)

    def _inertial_lag(self, full_segments: int, travel: float) -> Floats | None:
        """Return how far slipping segments stay behind the needle if they begin to stick, m.

        None without inertia. It is zero for segments that carried no force at the start of the
        step: they stick by displacement. If only inertia resists the motion of a segment, the
        segment moves by the mean of its own displacement and the needle's travel. Of two estimates
        of its own displacement, the one with the smaller lag is used. The lag is reduced where the
        stiffness of the tissue resists, too.
        """
        drift, count = self.contact.inertial_drift, min(full_segments, self._common_segments)
        if drift is None:
            return None
        direction, found = self._initial_slip_direction[:count], np.zeros(full_segments + 1)
        lag = np.min(direction * (0.5 * travel - drift[:2, :count]), axis=0)
        compliance = np.diagonal(self._slidings[full_segments][0].compliance)[:count]
        share = np.minimum(compliance / drift[2, :count], 1.0)
        found[:count] = share * direction * np.maximum(lag, 0.0)
        return found

    def _initial_friction(self, position: TipPosition) -> Floats:
        """Return the initial friction forces on the segments that contain the needle at the end.

        With a tangential penalty, the force per length of a sticking partial segment is unchanged
        when the tip is retracted in it. Material that is cut in the step carries no initial force.
        """
        full, cut_path = position.full_segments, self.cut_path
        found = cut_path.friction_force[: full + 1]
        if self.friction.stiffness > 0.0:
            length = cut_path.arcs[full] - cut_path.arcs[full - 1] if full < cut_path.count else 0.0
            if self._initial_partial is not None and self._initial_partial[0] == full:
                length = 1.0 / (self.instrument.lateral_penalty * self._initial_partial[1])
            if position.length < length:
                found = found.copy()
                found[-1] *= position.length / length
        return found

    # forces for a position of the tip

    def solve(
        self, position: ContactPosition, depth: float, low: float, high: float
    ) -> StepSolution:
        """Solve for the friction forces, and for the tip force between bounds.

        Parameters
        ----------
        position : ContactPosition
        depth : float, m
        low, high : float, N (N/m in 2D)
            Bounds of the axial tip force. They may be equal or infinite.
        """
        axis, full, cut_path = self.instrument.axis, position.full_segments, self.cut_path
        lengths = np.diff(cut_path.arcs[:full], prepend=0.0)
        friction_step = FrictionStep(
            friction=self.friction,
            kinetic=position.kinetic,
            slipped=cut_path.slip_since_stick[: full + 1],
            travel=position.before + (depth - self.depth),
            old=self._initial_friction(position),
            lengths=np.append(lengths, position.length),
            lag=self._inertial_lag(full, depth - self.depth),
        )
        start = np.append(friction_step.old, min(max(0.0, low), high))
        if self._guess is not None:
            start = _resized(self._guess, start)
        shaft, tip = position.shaft, (low, high, depth - float(axis.axial_coordinate(position.tip)))
        forces, slip, gaps = friction_step.solve(shaft.compliance, shaft.free, start, tip)
        self._guess = forces
        lateral_gap = axis.lateral_offset(position.tip) + shaft.lateral_tip_displacement(forces)
        axial_gap, slipped = -float(gaps[-1]), friction_step.after(slip)
        lateral = shaft.lateral(forces)
        return StepSolution(position, depth, forces, lateral, slip, slipped, axial_gap, lateral_gap)

    # Kernel: conditions under which return mapping leaves all friction forces at the kinetic limit.
    #     ds - du.e + eps (q_0 - q) > 0,    tau_s(slip since sticking) = tau_k,    q = tau_k
    # ds    travel of the needle in the step, m
    # du.e  axial displacement of a segment in the step, m
    # eps   compliance of its tangential penalty, m/N (0 without penalty)
    # q_0, q        friction force before and after the step, N (N/m in 2D)
    # tau_s, tau_k  present limit and kinetic limit of the friction force, N (N/m in 2D)
    # Source: optimality conditions of equation (10) in docs/theory.md.
    def all_slipping(self, step: TipSolution) -> StepSolution | None:
        """Return a step of path following as a solution of these equations.

        None if it is not one: a segment sticks, or its friction still weakens.

        Parameters
        ----------
        step : TipSolution
            A step from the last vertex of the cut path, with the friction of all segments at its
            kinetic limit.
        """
        contact, cut_path, count = self.contact, self.cut_path, self.cut_path.count
        length = float(np.linalg.norm(step.tip - cut_path.vertices[-1]))
        weights = step.trial.weights
        position = TipPosition(
            tip=step.tip,
            full_segments=count,
            length=length,
            trial=step.trial,
            kinetic=np.append(cut_path.kinetic, step.friction),
            cutting_force=step.cutting_force,
        )
        lateral = contact.lateral_forces(step.trial, step.forces)
        displacement = contact.displacements(lateral, step.trial, step.forces)[:, 0]
        own = self._field.means(LinearFunctionals(weights.nodes, weights.rows[1:]))[0, 0]
        before = np.append(self._before(count), own)
        after = np.append(displacement[:count], displacement[count + 1])
        lengths = np.append(np.diff(cut_path.arcs, prepend=0.0), length)
        released = self._initial_friction(position) - position.kinetic
        slip = step.depth - self.depth - (after - before)
        slip = slip + self.friction.slack(lengths) * released
        slipped = cut_path.slip_since_stick[: count + 1]
        limits = self.friction.limits(position.kinetic, slipped)
        if np.any(limits > position.kinetic * (1.0 + SAME_LIMIT)) or np.any(slip[1:] <= STUCK):
            return None
        return StepSolution(
            position=position,
            depth=step.depth,
            forces=np.append(position.kinetic, step.tip_force),
            lateral=step.lateral,
            slip=slip,
            slipped=np.abs(slip) + np.where(slip >= 0.0, slipped, 0.0),
            axial_gap=0.0,
            lateral_gap=step.residual,
        )


def _resized(guess: Floats, like: Floats) -> Floats:
    """Return initial forces for the present number of segments.

    The values of the partial segment and of the tip stay last.
    """
    found = like.copy()
    count = min(len(guess), len(like)) - 2
    found[:count], found[-2:] = guess[:count], guess[-2:]
    return found
