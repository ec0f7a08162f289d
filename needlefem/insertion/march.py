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
from needlefem.insertion.guide import Guide
from needlefem.insertion.result import Insertion, Outcome, Snap, Status
from needlefem.insertion.state import State
from needlefem.insertion.step import NoEquilibriumError, Step, StepSolver
from needlefem.needle.contact import Contact
from needlefem.needle.instrument import Instrument
from needlefem.scene import Scene

STICK_TOLERANCE = 1e-9
"""Backward motion of the needle against a shaft point that ends the march, m."""


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
    within : bool
        Whether it ends with the last whole piece before, not with the first beyond.
    speed : float, m/s
        Of the needle, which says no more than when states are reached.
    guide : Guide, optional
        What is known from a march nearby.

    Attributes
    ----------
    outcome : Outcome
        Set when `iterate` is exhausted.
    """

    def __init__(
        self,
        instrument: Instrument,
        responses: Responses,
        max_depth: float,
        *,
        within: bool = False,
        speed: float = np.inf,
        guide: Guide | None = None,
    ) -> None:
        self.instrument, self.max_depth, self.within = instrument, max_depth, within
        self._speed = speed
        self.contact = Contact(responses, instrument.axis.frame)
        self.outcome = Outcome(Status.STOPPED, "stopped by the caller")
        self.snaps: list[Snap] = []
        self._solver = StepSolver(instrument, self.contact, guide)
        self.states: list[State] = []

    def iterate(self) -> Iterator[State]:
        """Yield the states one by one; stop early by not asking for more."""
        try:
            yield from self._states_to_depth()
            self.outcome = Outcome(Status.COMPLETED, f"reached {self.states[-1].depth:.4g} m")
        except _StopError as stop:
            self.outcome = stop.outcome
        except NoEquilibriumError as error:
            self.outcome = Outcome(Status.NOT_CONVERGED, str(error))
        except OutsideError:
            self.outcome = Outcome(Status.LEFT_TISSUE, "the tip left the tissue")

    def result(self, scene: Scene, model: Model) -> Insertion:
        """Return the insertion, as far as it went, of a scene in its tissue."""
        return Insertion(
            scene=scene,
            model=model,
            instrument=self.instrument,
            outcome=self.outcome,
            states=tuple(self.states),
            pieces=tuple(self.contact.pieces),
            snaps=tuple(self.snaps),
            evaluations=self._solver.evaluations,
        )

    def _states_to_depth(self) -> Iterator[State]:
        yield from self._puncture()
        while self.states[-1].depth < self.max_depth:
            step = self._solve(self.instrument.spacing)
            if self.within and step.depth > self.max_depth:
                return
            if step.depth > self.states[-1].depth:
                yield self._accept(step)
            else:
                yield from self._snap()

    def _solve(self, length: float, depth: float | None = None) -> Step:
        return self._solver.solve(self.states[-1].tip, length, depth)

    def _keep(self, state: State) -> State:
        self.states.append(state)
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
                time=share * depth / self._speed,
                tip_force=share * limit,
                tip_lateral=share * held.tip_lateral,
            )
            yield self._keep(pressed)
        if reached < 1.0:
            sentence = f"the skin is cut at {depth:.4g} m, beyond the largest depth"
            raise _StopError(Status.NOT_PUNCTURED, sentence)
        self.contact.adopt(trial, 0, 0.0, np.zeros(len(lateral)), 0.0)
        self.states[-1] = dataclasses.replace(
            self.states[-1],
            axial=np.zeros(1),
            lateral=limit * lateral[None],
            tip_lateral=np.zeros(len(lateral)),
            moved=np.concatenate([[depth], np.zeros(len(lateral))])[None],
        )

    def _accept(self, step: Step, jumping: bool = False) -> State:
        """Make the step's piece part of the path and keep the state."""
        forces = step.forces
        lateral = self.contact.lateral_forces(step.trial, forces)
        moved = self.contact.displacements(lateral, step.trial, forces)
        self._check_slip(step.depth, moved)
        self._solver.follow(step)
        self.contact.adopt(step.trial, 1, step.friction, step.offset, step.compliance)
        weights = step.trial.weights
        return self._keep(
            State(
                depth=step.depth,
                tip=step.tip,
                tip_force=step.tip_force,
                cutting_force=step.cutting_force,
                tip_lateral=np.zeros(len(step.lateral)),
                tip_nodes=weights.nodes,
                tip_weights=weights.rows[0],
                axial=self.contact.axial,
                lateral=np.vstack([lateral, step.lateral]),
                moved=np.concatenate([moved[:-2], moved[-1:]]),
                jumping=jumping,
                time=step.depth / self._speed,
            )
        )

    def _check_slip(self, depth: float, moved: Floats) -> None:
        before = self.states[-1]
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
        first, depth = len(self.states) - 1, self.states[-1].depth
        spacing = self.instrument.spacing
        step = self._solve(spacing, depth)
        while step.excess > 0.0:
            yield self._accept(step, jumping=True)
            step = self._solve(spacing, depth)
        landing = _root(lambda length: self._solve(length, depth), spacing)
        yield self._accept(landing)
        self.snaps.append(Snap(depth, first, len(self.states) - 1))

    def _peak(self) -> Step | None:
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
        return best if best.depth > self.states[-1].depth else None


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


def _root(solve: Callable[[float], Step], spacing: float) -> Step:
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
