"""Path following: one monotone insertion, with the length of the cut path as independent variable.

Each step computes the depth at which the next material point is at the tip. The depth may
decrease along the path. Then the tip advances at fixed depth (a rupture) until its resistance
equals the cutting force again. All contact segments are assumed to slip forward, and this is
checked after each step. The last step is shorter, so that it ends at the requested depth. Path
following ends before a step in which friction or the tip would add energy; time stepping continues
from there.
"""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem._root_finding import golden_section, root_between
from needlefem.contact.condensed_contact import CondensedContact, ContactTrial
from needlefem.fem.compliance import ComplianceOperator
from needlefem.fem.interpolation import OutsideError
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.result import Insertion, LeftTissueError, Outcome, Rupture, Status
from needlefem.insertion.state import State, TipPhase, state_at_entry
from needlefem.insertion.tip_solver import (
    MOST_ITERATIONS,
    ROUND_OFF,
    TOLERANCE,
    NoEquilibriumError,
    TipSolution,
    TipSolver,
    WarmStart,
)
from needlefem.mesh.surface import TipWatch
from needlefem.needle.needle_interface import NeedleInterface
from needlefem.scene import Scene

STICK_TOLERANCE = 1e-9
"""Backward slip of a contact segment above which path following ends, m."""
AT_DEPTH = 1e-12
"""Tolerance of the requested depth, m."""
ENOUGH = 1e-3
"""Lateral tolerance of a trial step to the requested depth, over the remaining depth."""
CREATED = 5e-10
"""Energy that friction or the tip may add in a step, over the total absolute work."""
FROM_PUNCTURE = 2
"""Number of states up to the puncture."""
LITTLE = 0.25
"""Depth gained in a step, over that of the step before, below which a limit point is searched."""
PEAK = 1e-6
"""Tolerance of a limit point, relative to the step. At an interface the depth may have a kink."""
SURE = 0.95
"""Predicted length of the last step, over that of a full segment, below which it is used."""
STEADY = 0.5
"""Smallest depth per length in a predicted last step, over that of the step before."""
NEAREST = 1e-3
"""Length of the shortest step of a rupture, over that of a step beyond its end."""
ROUND_OFF_OF_LENGTH = 1e-12
"""Relative precision of the length of the step that ends a rupture."""
HALVINGS = 6
"""Largest number of halvings of a step that would leave the tissue."""

T = TypeVar("T", float, Floats)


class _StopError(Exception):
    """End of path following with a status."""

    def __init__(self, status: Status, sentence: str) -> None:
        self.outcome = Outcome(status, sentence)


class _PreviousStep(NamedTuple):
    """Data of the last state for the check of the next step.

    Parameters
    ----------
    path : array, shape (nsegments * dim,), N (N/m in 2D)
        Forces on the path.
    tip : ContactTrial
        Its first functional is the tip kernel of the state.
    at_tip : array, shape (nsegments * dim,), m/N
        Axial displacement of this functional under unit forces on the contact segments.
    tip_moved : float, m
        Axial displacement of this functional under all forces of the state.
    """

    path: Floats
    tip: ContactTrial
    at_tip: Floats
    tip_moved: float


class PathFollowing:
    """A monotone insertion.

    Parameters
    ----------
    instrument : NeedleInterface
        The needle on its axis.
    responses : ComplianceOperator
        Compliances of the stiffness matrix, shared by all insertions into the same tissue.
    max_depth : float, m
        Requested depth.
    within : bool
        Whether the insertion ends with the last full segment before the requested depth.
    speed : float, m/s
        Speed of the needle. It only determines the times of the states.
    warm_start : WarmStart, optional
        Initial values from an insertion with a nearby entry.

    Attributes
    ----------
    outcome : Outcome
        Set when `iterate` is exhausted.
    """

    def __init__(
        self,
        instrument: NeedleInterface,
        responses: ComplianceOperator,
        max_depth: float,
        *,
        within: bool = False,
        speed: float = np.inf,
        warm_start: WarmStart | None = None,
    ) -> None:
        self.instrument, self.max_depth, self.within = instrument, max_depth, within
        self._speed = speed
        self.contact = CondensedContact(responses, instrument.axis.frame)
        self.outcome = Outcome(Status.STOPPED, "ended before the requested depth")
        self.ruptures: list[Rupture] = []
        self.tip_solver = TipSolver(instrument, self.contact, warm_start)
        self._watch = TipWatch(instrument.interpolation.surface, instrument.axis.entry)
        self._before: _PreviousStep | None = None
        self._inside: Vector | None = None
        self.states: list[State] = []

    def iterate(self) -> Iterator[State]:
        """Yield the states one by one. The insertion stops if no further state is requested."""
        try:
            yield from self._states_to_depth()
            reached = f"reached {100.0 * self.states[-1].depth:.4g} cm"
            self.outcome = Outcome(Status.COMPLETED, reached)
        except _StopError as stop:
            self.outcome = stop.outcome
        except NoEquilibriumError as error:
            self.outcome = Outcome(Status.NOT_CONVERGED, str(error))
        except LeftTissueError as error:
            self.outcome = error.outcome
        except OutsideError:
            last = self.states[-1]
            self.outcome = LeftTissueError(last.tip, last.depth).outcome

    def result(self, scene: Scene, model: TissueModel) -> Insertion:
        """Return the insertion with all states so far."""
        return Insertion(
            scene=scene,
            model=model,
            instrument=self.instrument,
            outcome=self.outcome,
            states=tuple(self.states),
            segments=tuple(self.contact.segments),
            ruptures=tuple(self.ruptures),
            contact_solves=self.tip_solver.evaluations,
        )

    def _states_to_depth(self) -> Iterator[State]:
        yield from self._puncture()
        while self.max_depth - self.states[-1].depth > AT_DEPTH:
            end = None if self.within else self._predicted_end()
            if end is not None:
                yield self._accept(end)
                return
            step = self._next()
            peak = self._limit_point(step) if self._may_fall(step) else None
            highest = step if peak is None else peak
            if highest.depth > self.max_depth + AT_DEPTH:
                if self.within:
                    return
                yield self._accept(self._at_max_depth(highest), warm_start=highest)
            elif peak is not None or step.depth <= self.states[-1].depth:
                yield from self._rupture(peak)
            else:
                yield self._accept(step)

    def _may_fall(self, step: TipSolution) -> bool:
        """Say whether the depth may have a maximum within a step: the step gains little depth."""
        *_, before, last = self.states
        gained = last.depth - before.depth if len(self.states) > FROM_PUNCTURE else 0.0
        return step.depth - last.depth <= LITTLE * gained

    def _predicted_end(self) -> TipSolution | None:
        """Return the step to the requested depth, if the last step predicts its length.

        None if the next segment may be a full one, or if the depth grows less than in the last
        step. Then a step over a full segment is tried first.
        """
        if len(self.states) <= FROM_PUNCTURE:
            return None
        before, last = self.states[-2:]
        ahead, left = last.tip - before.tip, self.max_depth - last.depth
        made = math.sqrt(ahead @ ahead)
        gained = last.depth - before.depth
        if made <= 0.0 or left * made >= SURE * gained * self.instrument.spacing:
            return None
        rate = gained / made
        try:
            step = self.tip_solver.solve_to(last.tip, self.max_depth, left / rate, rate)
            if step is None or left < STEADY * rate * self._length(step):
                return None
            self._check_inside(step.tip, step.depth)
        except (OutsideError, LeftTissueError):
            return None
        return step

    def _solve(self, length: float, depth: float | None = None) -> TipSolution:
        return self.tip_solver.solve(self.states[-1].tip, length, depth)

    def _length(self, step: TipSolution) -> float:
        return float(np.linalg.norm(step.tip - self.states[-1].tip))

    def _next(self, depth: float | None = None) -> TipSolution:
        """Return the step over the next segment, or over a part of it that is in the tissue.

        A part is also tried if no equilibrium is found for the full segment.
        """
        last, length = self.states[-1], self.instrument.spacing
        for number in range(HALVINGS + 1):
            try:
                step = self._solve(length, depth)
                self._check_inside(step.tip, step.depth)
            except OutsideError:  # the whole tip kernel is outside of the tissue
                if number == HALVINGS:
                    ahead = last.tip + length * self.instrument.axis.direction
                    self._check_inside(ahead, last.depth)
                    raise
            except (LeftTissueError, NoEquilibriumError):
                if number == HALVINGS:
                    raise
            else:
                break
            length *= 0.5
        return step

    def _check_inside(self, tip: Vector, depth: float) -> None:
        """Raise a `LeftTissueError` if the tip crosses the surface on the line to a point."""
        if tip is self._inside:
            return
        last = self.states[-1]
        share = self._watch.first_exit(last.tip, tip)
        if share is not None:
            place = last.tip + share * (tip - last.tip)
            raise LeftTissueError(place, last.depth + share * (depth - last.depth))
        self._inside = tip

    def _at_max_depth(self, beyond: TipSolution) -> TipSolution:
        """Return the step to the requested depth: a part of a step that ends beyond it.

        Its length is found by bracketed inverse interpolation through the last three trial lengths.
        The initial slope is interpolated between those of the trials. Far from the requested depth
        the lateral equation is solved with a larger tolerance.
        """
        last, goal = self.states[-1], self.max_depth
        low, high = 0.0, self._length(beyond)
        known = [(last.depth - goal, low), (beyond.depth - goal, high)]
        slopes, step = [(high, beyond.slope)], beyond
        for _ in range(MOST_ITERATIONS):
            length = _interpolated(known[-3:], 0.0)
            if not low < length < high:
                length = 0.5 * (low + high)
            near = min(abs(known[-1][0]), high - low)
            tolerance = max(TOLERANCE, ENOUGH * near)
            begin = _interpolated(slopes[-3:], length)
            step = self.tip_solver.solve(last.tip, length, begin=begin, tolerance=tolerance)
            excess = step.depth - goal
            precise = float(abs(step.residual).max()) <= TOLERANCE
            if precise and (abs(excess) <= ROUND_OFF or high - low <= ROUND_OFF):
                break
            known.append((excess, length))
            slopes.append((length, step.slope))
            if excess > tolerance:
                high = length
            elif excess < -tolerance:
                low = length
        return step

    def _keep(self, state: State) -> State:
        self.states.append(state)
        return state

    def _puncture(self) -> Iterator[State]:
        """Load the entry point until the tip force equals the cutting force."""
        axis = self.instrument.axis
        weights = self.instrument.tip(axis.entry)
        trial = self.contact.trial(weights)
        lateral: Floats = -np.linalg.solve(trial.bare[1:, 1:], trial.bare[1:, 0]).astype(float)
        limit = self.instrument.cutting_force_at(weights)
        depth = limit * float(trial.bare[0, 0] + trial.bare[0, 1:] @ lateral)
        reached = min(1.0, self.max_depth / depth)
        for share in (0.0, reached):
            cut_state = state_at_entry(axis.entry, weights, limit, lateral)
            loaded = dataclasses.replace(
                cut_state,
                depth=share * depth,
                time=share * depth / self._speed,
                tip_force=share * limit,
                tip_lateral=share * cut_state.tip_lateral,
                tip_phase=TipPhase.CUTTING if share == 1.0 else TipPhase.LOADING,
            )
            yield self._keep(loaded)
        if reached < 1.0:
            largest = f"the largest depth, {100.0 * self.max_depth:.4g} cm"
            sentence = f"the skin is cut at {100.0 * depth:.4g} cm, beyond {largest}"
            raise _StopError(Status.NOT_PUNCTURED, sentence)
        self.contact.append_segment(trial, 0, 0.0, np.zeros(len(lateral)), 0.0)
        self.states[-1] = dataclasses.replace(
            self.states[-1],
            friction_force=np.zeros(1),
            lateral_force=limit * lateral[None],
            tip_lateral=np.zeros(len(lateral)),
            segment_displacement=np.concatenate([[depth], np.zeros(len(lateral))])[None],
        )
        path = np.append(0.0, limit * lateral)
        self._before = _PreviousStep(path, trial, trial.bare[0], depth)

    def _accept(
        self,
        step: TipSolution,
        *,
        phase: TipPhase = TipPhase.CUTTING,
        warm_start: TipSolution | None = None,
    ) -> State:
        """Append the segment of a step to the path, and store the state.

        The next insertion takes its initial values from `warm_start` instead of `step`, if given.
        """
        self._check_inside(step.tip, step.depth)
        if abs(step.depth - self.max_depth) <= AT_DEPTH:
            step = step._replace(depth=self.max_depth)
        forces = step.forces
        lateral = self.contact.lateral_forces(step.trial, forces)
        moved = self.contact.displacements(lateral, step.trial, forces)
        self._before = self._checked(step, forces, lateral, moved)
        self.tip_solver.follow(warm_start or step)
        self.contact.append_segment(step.trial, 1, step.friction, step.offset, step.compliance)
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
                friction_force=self.contact.friction_forces,
                lateral_force=np.vstack([lateral, step.lateral]),
                segment_displacement=np.concatenate([moved[:-2], moved[-1:]]),
                tip_phase=phase,
                time=step.depth / self._speed,
            )
        )

    # Kernel: slip of the shaft in a step, which must be forward at every segment.
    #     ds - du.e >= -1e-9 m
    # ds    travel of the needle in the step, m
    # du.e  axial displacement of a segment in the step, m
    # Source: Coulomb's friction with a constant limit; docs/theory.md, equation (9).
    def _checked(
        self, step: TipSolution, forces: Floats, lateral: Floats, moved: Floats
    ) -> _PreviousStep:
        """Check that all contact segments slip forward, and that contact adds no energy in a step.

        Slip is the travel of the needle minus the displacement of the tissue. Before the step, the
        material of the new segment is ahead of the tip. Path following also ends before a step in
        which friction or the tip would add energy: strained tissue at the tip then moves faster.

        Parameters
        ----------
        step : TipSolution
        forces : array, shape (2 dim,), N (N/m in 2D)
            Forces on the tip kernel and the new segment after the step.
        lateral : array, shape (nsegments, dim - 1), N (N/m in 2D)
            Lateral forces on the segments before the new one after the step.
        moved : array, shape (nsegments + 2, dim), m
            Displacement of the segments, the tip kernel and the new segment after the step.

        Returns
        -------
        The data for the check of the next step.
        """
        last, known, trial = self.states[-1], self._before, step.trial
        assert known is not None
        dim, count = len(moved[0]), len(last.segment_displacement)
        path = np.empty((count + 1, dim))
        path[:count, 0], path[:count, 1:] = last.friction_force, lateral
        path[count] = forces[dim:]
        flat = path.ravel()
        between = trial.loads @ known.tip.response.at(trial.rows)[:, 0]
        was = trial.coupling @ known.path + last.tip_force * between
        travel = step.depth - last.depth
        slip = travel - moved[1:count, 0] + last.segment_displacement[1:, 0]
        own = travel - float(moved[-1, 0] - was[dim])
        if own < -STICK_TOLERANCE or slip.min(initial=0.0) < -STICK_TOLERANCE:
            raise _StopError(
                Status.STICK_DETECTED,
                f"a point of the shaft stops slipping at depth {100.0 * step.depth:.4g} cm; "
                "path following ends there",
            )
        tip_moved = float(moved[-2, 0])
        old = travel - float(known.at_tip @ flat[:-dim] + between @ forces) + known.tip_moved
        new = travel - tip_moved + float(was[0])
        friction = float(last.friction_force[1:] @ slip) + 0.5 * step.friction * own
        if min(old, new, friction) < 0.0:
            self._check_energy(step, friction, old, new)
        at_tip = np.append(trial.coupling[0], trial.bare[0, dim:])
        return _PreviousStep(flat, trial, at_tip, tip_moved)

    def _check_energy(self, step: TipSolution, friction: float, old: float, new: float) -> None:
        """Raise a `_StopError` if friction, cutting or a rupture adds energy in a step.

        Parameters
        ----------
        step : TipSolution
        friction : float, J (J/m in 2D)
            Energy dissipated by friction.
        old, new : float, m
            Travel of the needle relative to the material at the tip, before and after the step.
        """
        last = self.states[-1]
        cutting = 0.5 * (last.cutting_force * old + step.cutting_force * new)
        excess = 0.5 * ((last.tip_force - last.cutting_force) * old + step.excess * new)
        least = min(friction, cutting, excess, friction + cutting + excess)
        force = np.array([state.force for state in self.states])
        travel = np.diff([state.depth for state in self.states])
        total_absolute_work = 0.5 * float((force[1:] + force[:-1]) @ np.abs(travel))
        if least < -CREATED * total_absolute_work:
            raise _StopError(
                Status.STICK_DETECTED,
                f"at depth {100.0 * step.depth:.4g} cm the tissue moves faster than the tip that "
                "cuts it; path following ends there",
            )

    def _rupture(self, peak: TipSolution | None) -> Iterator[State]:
        """Advance the tip at fixed depth from a limit point to the arrest."""
        if peak is not None:
            yield self._accept(peak)
        first, depth = len(self.states) - 1, self.states[-1].depth
        step = self._next(depth)
        while step.excess > 0.0:
            yield self._accept(step, phase=TipPhase.RUPTURE)
            step = self._next(depth)
        state = self._accept(self._arrest(step, depth))
        self.ruptures.append(Rupture(depth, first, len(self.states) - 1))
        yield state

    def _arrest(self, step: TipSolution, depth: float) -> TipSolution:
        """Return the step at fixed depth, shorter than a given one, that ends the rupture."""
        longest = self._length(step)
        shortest = NEAREST * longest
        first = self._solve(shortest, depth)
        if first.excess <= 0.0:
            return first
        length = root_between(
            lambda x: self._solve(x, depth).excess, shortest, longest, ROUND_OFF_OF_LENGTH * longest
        )
        return self._solve(length, depth)

    # Kernel: limit point of the depth over the path's length, where a rupture begins.
    #     ds/dl = 0
    # s, l  depth and length of the cut path, m
    # Source: limit points in path following, E. Riks, Int. J. Solids Struct. 15 (1979) 529.
    def _limit_point(self, step: TipSolution) -> TipSolution | None:
        """Return the step to the largest depth within a step; None if it is at an end."""
        high, tried = self._length(step), list[TipSolution]()

        def negative_depth(length: float) -> float:
            tried.append(self._solve(length))
            return -tried[-1].depth

        golden_section(negative_depth, 0.0, high, PEAK * high)
        best = max(tried, key=lambda found: found.depth)
        return best if best.depth > max(self.states[-1].depth, step.depth) else None


def _interpolated(points: Sequence[tuple[float, T]], at: float) -> T:
    """Return the value at a point of the polynomial through points, or NaN if two coincide."""
    parts = []
    for number, (place, value) in enumerate(points):
        others = [other for n, (other, _) in enumerate(points) if n != number]
        if place in others:
            return value * np.nan
        parts.append(value * math.prod((at - other) / (place - other) for other in others))
    return sum(parts[1:], parts[0])
