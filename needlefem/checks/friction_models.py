"""Models under dry friction with known behaviour: a shaft embedded in tissue, and oscillators.

Both use the friction of the needle, `needlefem.contact.FrictionStep`. The shaft is embedded in an
elastic tissue over its full length and is moved along its axis; it has no tip. The systems of
masses and springs are advanced by the integrators of the tissue, under the friction of a body that
moves at a constant velocity.
"""

import dataclasses
from collections.abc import Callable, Iterator

import numpy as np
from scipy.optimize import brentq

from needlefem._arrays import Floats, Vector
from needlefem.contact.condensed_contact import CondensedContact, straight_contact
from needlefem.contact.friction import FrictionStep, SlipWeakeningFriction
from needlefem.dynamics.energy import kinetic_energy
from needlefem.dynamics.steppers import AlphaParameters, ImplicitStepper, KinematicState
from needlefem.dynamics.system import MatrixSystem
from needlefem.fem.compliance import CachedCompliance
from needlefem.fem.tissue_model import TissueModel
from needlefem.needle.needle_interface import (
    InsertionAxis,
    NeedleInterface,
    PointKernel,
    cross_section,
)

LATERAL_STIFFNESS = 1e9
"""Lateral penalty, N/m^3; without effect where the tissue moves along the axis only."""
MEAN = AlphaParameters(0.5, 0.5, 0.25, 0.5)
"""Average acceleration; the mean friction force of each step is in equilibrium."""
END = AlphaParameters(0.0, 0.0, 0.25, 0.5)
"""Average acceleration; the friction force at the end of each step is in equilibrium."""
FINE = 1e-13
"""Tolerance of the time of an event relative to the step."""


class EmbeddedShaft:
    """A shaft in an unloaded tissue that is moved along its axis by prescribed distances.

    Parameters
    ----------
    model : TissueModel
    ends : two arrays, shape (dim,), m
        Ends of the shaft.
    segments : int
        Number of segments of equal length.
    limit : float, N/m (Pa in 2D)
        Kinetic friction per length.
    friction : SlipWeakeningFriction, optional
        Slip weakening and tangential penalty.
    thickness : float, m
        Radius over which the forces are distributed across the axis.

    Attributes
    ----------
    travel : float, m
    pull : array, shape (segments,), N (N/m in 2D)
        Friction forces on the segments.
    moved : array, shape (segments,), m
        Axial displacement of the tissue at the segments.
    slipping : array, shape (segments,)
        1, -1: direction of slip in the last step; 0: the segment stuck.
    dissipated : float, J (J/m in 2D)
        Friction work with the mean forces of the steps.
    """

    def __init__(
        self,
        model: TissueModel,
        ends: tuple[Vector, Vector],
        segments: int,
        limit: float,
        *,
        friction: SlipWeakeningFriction | None = None,
        thickness: float = 0.0,
    ) -> None:
        length = float(np.linalg.norm(ends[1] - ends[0]))
        self._contact = _path(model, ends, segments, thickness)
        self.friction = friction or SlipWeakeningFriction()
        self.lengths: Floats = np.full(segments, length / segments)
        self.kinetic: Floats = limit * self.lengths
        self.pull: Floats = np.zeros(segments)
        self.moved: Floats = np.zeros(segments)
        self.travel = self.dissipated = 0.0
        self.slipping: Floats = np.zeros(segments)
        self._slipped: Floats = np.zeros(segments)

    def move(self, travel: float) -> float:
        """Move the needle to a position (m, from its first one); return its force, N (N/m)."""
        friction_step = FrictionStep(
            friction=self.friction,
            kinetic=self.kinetic,
            slipped=self._slipped,
            travel=self.moved + (travel - self.travel),
            old=self.pull,
            lengths=self.lengths,
        )
        sliding = self._contact.sliding()
        forces, slip, _ = friction_step.solve(sliding.compliance, sliding.displacement, self.pull)
        self.dissipated += 0.5 * float((self.pull + forces) @ slip)
        self._slipped = friction_step.after(slip)
        self.moved = sliding.displacement + sliding.compliance @ forces
        self.pull, self.slipping, self.travel = forces, np.sign(slip), travel
        return float(forces.sum())

    @property
    def strain_energy(self) -> float:
        """Strain energy of the tissue, J (J/m in 2D)."""
        return 0.5 * float(self.pull @ self.moved)


def _path(
    model: TissueModel, ends: tuple[Vector, Vector], segments: int, thickness: float
) -> CondensedContact:
    """Return a contact with a path of equal segments and a lateral penalty."""
    start, end = ends
    direction = (end - start) / np.linalg.norm(end - start)
    instrument = NeedleInterface(
        axis=InsertionAxis(start, direction),
        kernel=PointKernel(model.dim),
        interpolation=model.interpolation,
        cutting_force=np.zeros(model.nnodes),
        shaft_friction=np.zeros(model.nnodes),
        section=cross_section(thickness, 24 if thickness else 1, model.dim),
        lateral_penalty=LATERAL_STIFFNESS,
        spacing=float(np.linalg.norm(end - start)) / segments,
        inward=direction,
    )
    return straight_contact(instrument, CachedCompliance(model), segments)


# Systems of masses and springs, such as the friction oscillator.


@dataclasses.dataclass(frozen=True, eq=False)
class FrictionState:
    """State of a system under friction at one time.

    Parameters
    ----------
    time : float, s
    motion : KinematicState
    pull : array, shape (k,), N
        Friction forces of the last step.
    slid : array, shape (k,)
        1, -1: direction in which the counterpart slid in the last step; 0: the point stuck.
    slipped : array, shape (k,), m
        Slip since the point last stuck.
    work : float, J
        Work of the load and of the counterpart.
    dissipated : float, J
        Friction work: friction force of a step times slip.
    damped : float, J
        Viscous dissipation.
    """

    time: float
    motion: KinematicState
    pull: Floats
    slid: Floats
    slipped: Floats
    work: float = 0.0
    dissipated: float = 0.0
    damped: float = 0.0


class FrictionSystem:
    """``M a + C v + K u = f + B^T p`` with friction p on a counterpart of constant velocity.

    Parameters
    ----------
    system : MatrixSystem
    rows : array, shape (k, n)
        Points with friction, B.
    kinetic : float, N
        Kinetic friction limit of each point.
    friction : SlipWeakeningFriction
        Slip weakening.
    speed : float, m/s
        Velocity of the counterpart.
    load : callable, optional
        Takes a time, s; returns the force on the system, shape (n,), N.
    weights : AlphaParameters, optional
        `MEAN` or `END`.
    """

    def __init__(
        self,
        system: MatrixSystem,
        rows: Floats,
        kinetic: float,
        friction: SlipWeakeningFriction,
        *,
        speed: float,
        load: Callable[[float], Floats] | None = None,
        weights: AlphaParameters = MEAN,
    ) -> None:
        self.system, self.rows, self.friction = system, rows, friction
        self.kinetic: Floats = np.full(len(rows), kinetic)
        self.speed, self.weights = speed, weights
        self._load = load
        self._steppers: dict[float, tuple[ImplicitStepper, Floats]] = {}

    def load(self, time: float) -> Floats:
        """Return the force on the system, shape (n,), N."""
        return np.zeros(self.system.size) if self._load is None else self._load(time)

    def start(self, u: Floats, v: Floats) -> FrictionState:
        """Return the initial state; points with the velocity of the counterpart stick."""
        away = self.speed - self.rows @ v
        slid, motion = np.sign(away), KinematicState(u, v, np.zeros_like(u))
        pull, slipped = slid * self.kinetic, np.where(slid == 0.0, 0.0, np.inf)
        force = self.load(0.0) + self.rows.T @ pull
        a = self.system.factor(1.0, 0.0, 0.0).solve(force - self.system.products(None, v, u))
        return FrictionState(0.0, dataclasses.replace(motion, a=a), pull, slid, slipped)

    def _ready(self, duration: float, *, keep: bool) -> tuple[ImplicitStepper, Floats]:
        if duration in self._steppers:
            return self._steppers[duration]
        stepper = ImplicitStepper(self.system, duration, self.weights)
        found = stepper, stepper.factor.solve(self.rows.T).reshape(self.rows.T.shape)
        if keep:
            self._steppers[duration] = found
        return found

    def step(self, old: FrictionState, duration: float, *, keep: bool = True) -> FrictionState:
        """Return the state after a step."""
        stepper, columns = self._ready(duration, keep=keep)
        force = self._force(old, duration)
        free = stepper.free_displacement(old.motion, force)
        before, way = self.rows @ old.motion.u, self.speed * duration
        late = 0.5 * (way - duration * (self.rows @ old.motion.v))
        friction_step = FrictionStep(
            friction=self.friction,
            kinetic=self.kinetic,
            slipped=old.slipped,
            travel=before + way,
            old=old.pull,
            lengths=np.ones(len(before)),
            lag=old.slid * np.maximum(old.slid * late, 0.0),
        )
        pull, slip, _ = friction_step.solve(self.rows @ columns, self.rows @ free, old.pull)
        motion = stepper.advance(old.motion, free + columns @ pull)
        apart = way - (self.rows @ motion.u - before)
        mean = 0.5 * (self.load(old.time) + self.load(old.time + duration))
        moved = motion.u - old.motion.u
        drag = self.system.products(None, 0.5 * (old.motion.v + motion.v), None)
        work = float(pull.sum() * way + mean @ moved)
        return FrictionState(
            time=old.time + duration,
            motion=motion,
            pull=pull,
            slid=np.sign(slip),
            slipped=friction_step.after(slip),
            work=old.work + work,
            dissipated=old.dissipated + float(pull @ apart),
            damped=old.damped + float(drag @ moved),
        )

    def _force(self, old: FrictionState, duration: float) -> Floats:
        """Return the load at the time of equilibrium in the step."""
        before, share = self.load(old.time), self.weights.force
        return share * before + (1.0 - share) * self.load(old.time + duration)

    def missing(self, start: FrictionState, end: FrictionState) -> float:
        """Return the energy residual between two states, relative to the work."""
        energies = [
            kinetic_energy(self.system, state.motion.v) + self.system.strain_energy(state.motion.u)
            for state in (start, end)
        ]
        spent = energies[1] - energies[0] + end.dissipated - start.dissipated
        spent += end.damped - start.damped
        work = end.work - start.work
        return abs(work - spent) / abs(work)

    def iterate(self, state: FrictionState, step: float, count: int) -> Iterator[FrictionState]:
        """Yield the states after steps of equal duration."""
        for _ in range(count):
            state = self.step(state, step)
            yield state

    def last(self, state: FrictionState, step: float, count: int) -> FrictionState:
        """Return the state after a number of steps of equal duration."""
        for _ in range(count):
            state = self.step(state, step)
        return state

    # one point, with exact times of its events

    def located(self, state: FrictionState, step: float, until: float) -> Iterator[FrictionState]:
        """Yield the states of a single point; steps end where it sticks or begins to slip."""
        while state.time < until - FINE * step:
            duration = min(step, until - state.time)
            event = self._event(state, duration)
            if event is None:
                state = self.step(state, duration, keep=duration == step)
            else:
                new = self.step(state, event, keep=False)
                state = self._at_event(new, sliding=bool(state.slid[0]))
            yield state

    def _event(self, state: FrictionState, duration: float) -> float | None:
        """Return the time until the point sticks or begins to slip, or None if after the step."""

        def ahead(tried: float) -> float:
            if state.slid[0] == 0.0:
                return self._limit() - abs(self.reaction(self.step(state, tried, keep=False)))
            motion = self._sliding(state, tried)
            return float(state.slid[0] * (self.speed - self.rows @ motion.v)[0])

        tiny = 1e-9 * duration
        if ahead(tiny) <= 0.0 or ahead(duration) > 0.0:
            return None
        return float(brentq(ahead, tiny, duration, xtol=FINE * duration))

    def _sliding(self, state: FrictionState, duration: float) -> KinematicState:
        """Return the motion if the points continue to slide."""
        stepper, columns = self._ready(duration, keep=False)
        free = stepper.free_displacement(state.motion, self._force(state, duration))
        return stepper.advance(state.motion, free + columns @ (state.slid * self.kinetic))

    def _limit(self) -> float:
        return float(self.friction.limits(self.kinetic, np.zeros(len(self.kinetic)))[0])

    def reaction(self, state: FrictionState) -> float:
        """Return the force that keeps the velocity of a point constant, N (a multiplier)."""
        inverse, motion = self.system.factor(1.0, 0.0, 0.0), state.motion
        force = self.load(state.time)
        free = inverse.solve(force - self.system.products(None, motion.v, motion.u))
        gentle = self.rows @ inverse.solve(self.rows.T).reshape(self.rows.T.shape)
        return -float(np.linalg.solve(gentle, self.rows @ free)[0])

    def _at_event(self, state: FrictionState, *, sliding: bool) -> FrictionState:
        """Return the state after the event, with the acceleration that then follows."""
        motion, none = state.motion, np.zeros(1)
        needed = self.reaction(state)
        if sliding and abs(needed) <= self._limit():
            pull, slid, slipped = np.array([needed]), none, none
        else:  # it begins to slip, or reverses its direction
            slid = np.array([np.sign(needed)])
            pull, slipped = slid * self.kinetic, none
        force = self.load(state.time) + self.rows.T @ pull
        rest = force - self.system.products(None, motion.v, motion.u)
        a = self.system.factor(1.0, 0.0, 0.0).solve(rest)
        fresh = KinematicState(motion.u, motion.v, a, motion.parts)
        return dataclasses.replace(state, motion=fresh, pull=pull, slid=slid, slipped=slipped)
