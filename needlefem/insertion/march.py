"""One monotone insertion as a march along the cut path.

The independent variable is the length of path in the material, not the depth: every step asks
which depth puts the next material point at the tip. Depth comes out, and may fall back: there
the tip would run ahead at fixed depth (a snap), until its resistance is back at the cutting
force. Every shaft point is taken to slip forward, which is checked after every step.
"""

import dataclasses
from collections.abc import Callable, Iterator

import numpy as np

from needlefem.arrays import Floats, Vector
from needlefem.fem.interpolation import OutsideError, Weights
from needlefem.fem.model import Model
from needlefem.fem.responses import Responses
from needlefem.insertion.result import Insertion, Outcome, Snap, State, Status
from needlefem.needle.contact import Contact, Trial
from needlefem.needle.instrument import Instrument
from needlefem.scene import Scene

TOLERANCE = 1e-12
"""Lateral distance of the tip from the axis at which a step is solved, m."""
MOST_ITERATIONS = 40
STICK_TOLERANCE = 1e-9
"""Backward motion of the needle against a shaft point that ends the march, m."""


@dataclasses.dataclass(frozen=True)
class _Step:
    """A step that satisfies the axial equations; `residual` is the lateral miss of the tip, m."""

    tip: Vector
    trial: Trial
    depth: float
    tip_force: float
    excess: float
    friction: float
    lateral: Floats
    offset: Floats
    compliance: float
    residual: Floats

    @property
    def forces(self) -> Floats:
        """Forces on the trial's functionals."""
        none = np.zeros_like(self.lateral)
        return np.concatenate([[self.tip_force], none, [self.friction], self.lateral])


class _StopError(Exception):
    def __init__(self, status: Status, sentence: str) -> None:
        self.outcome = Outcome(status, sentence)


class March:
    """A monotone insertion.

    Parameters
    ----------
    instrument : Instrument
        The needle on its line.
    responses : Responses
        Of K; shared by all marches in the same tissue.
    max_depth : float, m
        Where it ends.

    Attributes
    ----------
    outcome : Outcome
        Set when `iterate` is exhausted.
    """

    def __init__(self, instrument: Instrument, responses: Responses, max_depth: float) -> None:
        self.instrument, self.max_depth = instrument, max_depth
        self.contact = Contact(responses, instrument.axis.frame)
        self.outcome = Outcome(Status.STOPPED, "stopped by the caller")
        self.snaps: list[Snap] = []
        self.evaluations = 0
        lateral = instrument.axis.laterals.shape[0]
        self._slope = np.zeros(lateral)
        self._jacobian = np.eye(lateral)
        self._states: list[State] = []

    def iterate(self) -> Iterator[State]:
        """Yield the states one by one; stop early by not asking for more."""
        try:
            yield from self._states_to_depth()
            self.outcome = Outcome(Status.COMPLETED, f"reached {self._states[-1].depth:.4g} m")
        except _StopError as stop:
            self.outcome = stop.outcome
        except OutsideError:
            self.outcome = Outcome(Status.LEFT_TISSUE, "the tip left the tissue")

    def result(self, scene: Scene, model: Model) -> Insertion:
        """Return the insertion, as far as it went, of a scene in its tissue."""
        return Insertion(
            scene=scene,
            model=model,
            instrument=self.instrument,
            outcome=self.outcome,
            states=tuple(self._states),
            pieces=tuple(self.contact.pieces),
            snaps=tuple(self.snaps),
            evaluations=self.evaluations,
        )

    def _states_to_depth(self) -> Iterator[State]:
        yield from self._puncture()
        while self._states[-1].depth < self.max_depth:
            step = self._solve(self.instrument.spacing)
            if step.depth > self._states[-1].depth:
                yield self._accept(step)
            else:
                yield from self._snap()

    def _keep(self, state: State) -> State:
        self._states.append(state)
        return state

    def _puncture(self) -> Iterator[State]:
        """Press on the entry point until the tip's force is that of cutting."""
        axis = self.instrument.axis
        weights = self.instrument.tip(axis.entry)
        trial = self.contact.try_functionals(weights)
        lateral: Floats = -np.linalg.solve(trial.bare[1:, 1:], trial.bare[1:, 0]).astype(float)
        limit = self.instrument.cutting_force_at(weights)
        depth = limit * float(trial.bare[0, 0] + trial.bare[0, 1:] @ lateral)
        reached = min(1.0, self.max_depth / depth)
        for share in (0.0, reached):
            held = _held(axis.entry, weights, limit, lateral)
            pressed = dataclasses.replace(
                held,
                depth=share * depth,
                tip_force=share * limit,
                tip_lateral=share * held.tip_lateral,
            )
            yield self._keep(pressed)
        if reached < 1.0:
            sentence = f"the skin is cut at {depth:.4g} m, beyond the largest depth"
            raise _StopError(Status.NOT_PUNCTURED, sentence)
        self.contact.adopt(trial, 0, 0.0, np.zeros(len(lateral)), 0.0)
        self._states[-1] = dataclasses.replace(
            self._states[-1],
            axial=np.zeros(1),
            lateral=limit * lateral[None],
            tip_lateral=np.zeros(len(lateral)),
            moved=np.concatenate([[depth], np.zeros(len(lateral))])[None],
        )

    def _try(self, length: float, sideways: Floats, depth: float | None) -> _Step:
        """Put the tip `length` further along the path, `sideways` of it across the axis.

        With `depth` given the tip's force is what holds the tip there; else it is the cutting
        force, and the depth follows.
        """
        self.evaluations += 1
        axis, last = self.instrument.axis, self._states[-1].tip
        forward = np.sqrt(length**2 - sideways @ sideways)
        tip = last + forward * axis.direction + sideways @ axis.laterals
        weights = self.instrument.tip_and_piece(tip, last)
        trial = self.contact.try_functionals(weights)
        dim = self.contact.dim
        friction = self.instrument.friction_at(weights) * length
        compliance = 1.0 / (self.instrument.lateral_stiffness * length)
        offset = axis.offset(0.5 * (tip + last))
        hold = trial.compliance[dim + 1 :, dim + 1 :] + compliance * np.eye(dim - 1)
        loose = trial.displacement + friction * trial.compliance[:, dim]
        # lateral force on the new piece: constant part, and part per unit of tip force
        rhs = -np.stack([offset + loose[dim + 1 :], trial.compliance[dim + 1 :, 0]], axis=1)
        lateral = np.linalg.solve(hold, rhs)
        moved = np.stack([loose, trial.compliance[:, 0]], axis=1)[:dim]
        moved = moved + trial.compliance[:dim, dim + 1 :] @ lateral
        ahead = float(axis.along(tip))
        limit = self.instrument.cutting_force_at(weights)
        force = limit if depth is None else (depth - ahead - moved[0, 0]) / moved[0, 1]
        return _Step(
            tip=tip,
            trial=trial,
            depth=float(ahead + moved[0] @ [1.0, force]),
            tip_force=float(force),
            excess=float(force - limit),
            friction=friction,
            lateral=lateral @ [1.0, force],
            offset=offset,
            compliance=compliance,
            residual=axis.offset(tip) + moved[1:] @ [1.0, force],
        )

    def _solve(self, length: float, depth: float | None = None) -> _Step:
        """Find the step whose tip is on the axis (Broyden's method; the secant in 2D)."""
        sideways = self._slope * length
        step = self._try(length, sideways, depth)
        jacobian = self._jacobian
        for _ in range(MOST_ITERATIONS):
            if np.max(np.abs(step.residual)) <= TOLERANCE:
                self._jacobian = jacobian
                return step
            change = -np.linalg.solve(jacobian, step.residual)
            wanted = sideways + change
            wanted *= min(1.0, 0.9 * length / float(np.linalg.norm(wanted)))
            change = wanted - sideways
            new = self._try(length, wanted, depth)
            error = new.residual - step.residual - jacobian @ change
            jacobian = jacobian + np.outer(error, change) / (change @ change)
            sideways, step = wanted, new
        raise _StopError(
            Status.NOT_CONVERGED,
            f"no equilibrium found {length:.3g} m ahead of {self._states[-1].tip} m",
        )

    def _accept(self, step: _Step, jumping: bool = False) -> State:
        """Make the step's piece part of the path and keep the state."""
        forces = step.forces
        lateral = self.contact.lateral_forces(step.trial, forces)
        moved = self.contact.displacements(lateral, step.trial, forces)
        self._check_slip(step.depth, moved)
        self._slope = self.instrument.axis.offset(step.tip) - self.instrument.axis.offset(
            self._states[-1].tip
        )
        self._slope = self._slope / np.linalg.norm(step.tip - self._states[-1].tip)
        self.contact.adopt(step.trial, 1, step.friction, step.offset, step.compliance)
        weights = step.trial.weights
        return self._keep(
            State(
                depth=step.depth,
                tip=step.tip,
                tip_force=step.tip_force,
                cutting_force=step.tip_force - step.excess,
                tip_lateral=np.zeros(len(step.lateral)),
                tip_nodes=weights.nodes,
                tip_weights=weights.rows[0],
                axial=self.contact.axial,
                lateral=np.vstack([lateral, step.lateral]),
                moved=np.delete(moved, -2, axis=0),
                jumping=jumping,
            )
        )

    def _check_slip(self, depth: float, moved: Floats) -> None:
        before = self._states[-1]
        count = len(before.moved)
        slip = depth - before.depth - (moved[:count, 0] - before.moved[:, 0])
        if count > 1 and slip[1:].min() < -STICK_TOLERANCE:
            raise _StopError(
                Status.RESTICK,
                f"a shaft point stops slipping at depth {depth:.4g} m; the march ends there",
            )

    def _snap(self) -> Iterator[State]:
        """Go on from where depth would fall back: at fixed depth, until the tip holds again."""
        peak = self._peak()
        if peak is not None:
            yield self._accept(peak)
        first, depth = len(self._states) - 1, self._states[-1].depth
        spacing = self.instrument.spacing
        step = self._solve(spacing, depth)
        while step.excess > 0.0:
            yield self._accept(step, jumping=True)
            step = self._solve(spacing, depth)
        landing = _root(lambda length: self._solve(length, depth), spacing)
        yield self._accept(landing)
        self.snaps.append(Snap(depth, first, len(self._states) - 1))

    def _peak(self) -> _Step | None:
        """Return the step to the largest depth within one spacing, if there is one ahead."""
        spacing = self.instrument.spacing
        low, high = 0.0, spacing
        ratio = 0.5 * (np.sqrt(5.0) - 1.0)
        inner = [self._solve(high - ratio * (high - low)), self._solve(low + ratio * (high - low))]
        lengths = [high - ratio * (high - low), low + ratio * (high - low)]
        while high - low > 1e-3 * spacing:
            if inner[0].depth > inner[1].depth:
                high, lengths[1], inner[1] = lengths[1], lengths[0], inner[0]
                lengths[0] = high - ratio * (high - low)
                inner[0] = self._solve(lengths[0])
            else:
                low, lengths[0], inner[0] = lengths[0], lengths[1], inner[1]
                lengths[1] = low + ratio * (high - low)
                inner[1] = self._solve(lengths[1])
        best = max(inner, key=lambda step: step.depth)
        return best if best.depth > self._states[-1].depth else None


def _held(entry: Vector, weights: Weights, limit: float, lateral: Floats) -> State:
    """Return the state of a tip that presses on the entry point, about to cut."""
    none = np.zeros((0, len(lateral)))
    return State(
        depth=0.0,
        tip=entry,
        tip_force=limit,
        cutting_force=limit,
        tip_lateral=limit * lateral,
        tip_nodes=weights.nodes,
        tip_weights=weights.rows[0],
        axial=np.zeros(0),
        lateral=none,
        moved=np.zeros((0, len(lateral) + 1)),
    )


def _root(solve: Callable[[float], _Step], spacing: float) -> _Step:
    """Return the step, of length up to `spacing`, in which the excess force is gone."""
    low, high = 1e-3 * spacing, spacing
    for _ in range(60):
        step = solve(0.5 * (low + high))
        if step.excess > 0.0:
            low = 0.5 * (low + high)
        else:
            high = 0.5 * (low + high)
        if high - low < 1e-9 * spacing:
            break
    return solve(high)
