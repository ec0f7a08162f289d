"""One step of path following: position of the tip, its depth, and the initial guess for both."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.contact.condensed_contact import CondensedContact, ContactTrial
from needlefem.fem.interpolation import OutsideError
from needlefem.mesh.surface import place_text
from needlefem.needle.needle_interface import InsertionAxis, NeedleInterface

Learnt = tuple[Floats, Floats]
"""Direction of the tip across the axis, shape (dim - 1,), in a step, and the derivative of the
tip's distance from the axis to it, shape (dim - 1, dim - 1)."""


class WarmStart:
    """Guesses for a march, step by step.

    Parameters
    ----------
    entry : array, shape (dim,), m
        Where the needle enters the skin.
    expected : sequence of (direction, derivative)
        Of its steps; may be empty.

    Attributes
    ----------
    learnt : list of (direction, derivative)
        Steps made so far.
    last : LastStep or None
        The step that ended at the requested depth.
    """

    def __init__(
        self,
        entry: Vector,
        expected: Sequence[Learnt] = (),
        expected_last: "LastStep | None" = None,
    ) -> None:
        self.entry, self.learnt = entry, list[Learnt]()
        self._expected = expected
        self.last: LastStep | None = None
        self._expected_last = expected_last

    def for_entry(self, entry: Vector, near: float) -> "WarmStart":
        """Return the guide of the next march: of no use unless its entry is near (m)."""
        apart = float(np.linalg.norm(entry - self.entry))
        return WarmStart(entry, self.learnt, self.last) if apart <= near else WarmStart(entry)

    def guess(self, slope: Floats, jacobian: Floats) -> Learnt:
        """Return direction and derivative to begin the next step with, from those of the last."""
        number = len(self.learnt)
        if not 0 < number < len(self._expected):
            return slope, jacobian
        (then, _), (now, known) = self._expected[number - 1 : number + 1]
        return slope + now - then, known

    def guess_last(self) -> "LastStep | None":
        """Return what the last step of the march nearby was, if the next one is its equal."""
        last = self._expected_last
        if last is None or len(self.learnt) != last.number or last.number == 0:
            return None
        return last


@dataclasses.dataclass(frozen=True, eq=False)
class LastStep:
    """A step that ended at the requested depth.

    Parameters
    ----------
    number : int
        Number of steps before it.
    length : float, m
    turned : array, shape (dim - 1,)
        Its direction less that of the step before.
    derivatives : array, shape (dim, dim)
        Of depth and lateral distance, m, to length, m, and direction.
    """

    number: int
    length: float
    turned: Floats
    derivatives: Floats


# One step along the cut path: the next position of the tip, and its depth.


TOLERANCE = 1e-12
"""Lateral distance of the tip from the axis at which a step is solved, m."""
STALLED = 1e-15
"""Change of the tip's direction below which iterating is in vain."""
STEEPEST = 0.9
"""Largest sine of the angle between a step and the needle's axis."""
MOST_ITERATIONS = 40
ROUND_OFF = 1e-14
"""Distance from the requested depth to which the last step is solved, m."""
LEAST_TURNING = 0.25
"""Lateral displacement of the tip over that on its path below which its direction is lost."""
DIFFERENCE = 0.05
"""Lateral displacement, over the length of the step, to look at that."""
PLANE = 2
FEW_ITERATIONS = 10
"""Of a step whose length is solved for as well; a good guess takes five."""


class TipSolution(NamedTuple):
    """A step that satisfies the axial equations.

    Parameters
    ----------
    tip : array, shape (dim,), m
        Material point at the tip.
    trial : ContactTrial
        Its functionals: the tip's kernel, and the piece of path behind it.
    depth : float, m
    tip_force, cutting_force : float, N (N/m in 2D)
        Axial force of the tip, and that at which it cuts there.
    friction : float, N (N/m in 2D)
        On the piece.
    lateral : array, shape (dim - 1,), N (N/m in 2D)
        On the piece.
    offset : array, shape (dim - 1,), m
        Lateral offset of the piece's material from the axis, undeformed.
    compliance : float, m/N
        Of the piece's lateral hold.
    residual : array, shape (dim - 1,), m
        Lateral distance of the tip from the axis.
    slope : array, shape (dim - 1,)
        Of the path across the axis, over its length.
    """

    tip: Vector
    trial: ContactTrial
    depth: float
    tip_force: float
    cutting_force: float
    friction: float
    lateral: Floats
    offset: Floats
    compliance: float
    residual: Floats
    slope: Floats

    @property
    def forces(self) -> Floats:
        """Forces on the trial's functionals."""
        none = np.zeros_like(self.lateral)
        return np.concatenate([[self.tip_force], none, [self.friction], self.lateral])

    @property
    def excess(self) -> float:
        """Force of the tip beyond that of cutting."""
        return self.tip_force - self.cutting_force


class NoEquilibriumError(Exception):
    """No step of this length was found."""


def not_found(length: float, last: Vector, turning: float, limit: float) -> str:
    """Return what to say when no step of a length (m) from a material point (m) was found.

    Parameters
    ----------
    length : float, m
    last : array, shape (dim,), m
    turning : float
        Lateral displacement of the tip's material over that of the tip on its path, at the
        direction that was expected: 1 in rigid tissue, 0 where strained tissue leaves no direction.
    limit : float, N (N/m in 2D)
        Cutting force there.
    """
    sentence = (
        f"no equilibrium was found with the tip {1e3 * length:.3g} mm beyond {place_text(last)} of "
        "the tissue; "
    )
    if not turning < LEAST_TURNING:
        return sentence + (
            "shorten discretization.path_spacing or refine the mesh along the needle"
        )
    unit = "N/m" if len(last) == PLANE else "N"
    return sentence + (
        "the tissue at the tip is strained beyond what small strain describes: lower the cutting "
        f"force there, to about {0.5 * limit:.3g} {unit}, or take a stiffer tissue"
    )


def smallest_turning(beside: Callable[[Floats], Floats], sideways: Floats, length: float) -> float:
    """Return the smallest derivative of the tip's lateral place to its lateral place on the path.

    Parameters
    ----------
    beside : callable
        Takes the tip's place across the axis, shape (dim - 1,), m; returns its lateral distance
        from the axis, in the same way.
    sideways : array, shape (dim - 1,), m
    length : float, m
        Of the step, which scales the differences.

    Returns
    -------
    Real part of the smallest eigenvalue; NaN where there is no tissue.
    """
    change = DIFFERENCE * length
    try:
        columns = [
            (beside(sideways + change * unit) - beside(sideways - change * unit)) / (2.0 * change)
            for unit in np.eye(len(sideways))
        ]
    except OutsideError:
        return float("nan")
    return float(np.linalg.eigvals(np.column_stack(columns)).real.min())


class TipSolver:
    """Finds steps from the end of the path, learning from one for the next.

    Parameters
    ----------
    instrument : NeedleInterface
    contact : CondensedContact
        The path so far.
    guide : WarmStart, optional
        What is known from a march nearby.
    """

    def __init__(
        self, instrument: NeedleInterface, contact: CondensedContact, guide: WarmStart | None = None
    ) -> None:
        self._instrument, self._contact = instrument, contact
        self._guide = guide or WarmStart(instrument.axis.entry)
        lateral = len(instrument.axis.lateral_directions)
        self._slope = np.zeros(lateral)
        self._jacobian = np.eye(lateral)
        self.evaluations = 0

    def follow(self, step: TipSolution) -> None:
        """Expect the next step to go on in the direction of one just made."""
        self._slope = step.slope
        self._guide.learnt.append((self._slope, self._jacobian))

    # Kernel: one step of path following, a root of the lateral equations of the tip.
    #     n.(X + u(X)) = 0,    s = e.(X + u(X)),    X = X_0 + l (sqrt(1 - a.a) e + a n)
    # X, X_0  material point at the tip after and before the step, m
    # u(X)    mean displacement over the tip's kernel at X, m
    # l, a    length of the step, m; its slope across the axis (unknown)
    # e, n    unit vectors along and across the axis
    # s       depth, m (a result)
    # Source: C. G. Broyden, Math. Comp. 19 (1965) 577; docs/theory.md, section on path following.
    def solve(
        self,
        last: Vector,
        length: float,
        depth: float | None = None,
        begin: Floats | None = None,
        tolerance: float = TOLERANCE,
    ) -> TipSolution:
        """Find the step whose tip is on the axis (Broyden's method; the secant in 2D).

        Parameters
        ----------
        last : array, shape (dim,), m
            Material point at the tip now.
        length : float, m
            Distance of the next one from it.
        depth : float, m, optional
            When given, the tip's force is what holds the tip at this depth; else it is the
            cutting force, and the depth follows.
        begin : array, shape (dim - 1,), optional
            Slope to begin with; when left out, what the steps before suggest.
        tolerance : float, m
            Lateral distance of the tip from the axis at which the step is solved.

        Raises
        ------
        NoEquilibriumError
        """
        start = _Start(last, self._instrument.axis)
        slope, jacobian = begin, self._jacobian
        if slope is None:
            slope, jacobian = self._guide.guess(self._slope, jacobian)
        steep = math.sqrt(slope @ slope)
        if steep > STEEPEST:  # an extrapolated direction can be none
            slope = slope * (STEEPEST / steep)
        sideways = slope * length
        step = self._try(start, length, sideways, depth)
        for _ in range(MOST_ITERATIONS):
            if _largest(step.residual) <= tolerance:
                self._jacobian = jacobian
                return step
            change = -solved(jacobian, step.residual)
            wanted = sideways + change
            size = _norm(wanted)
            if size > STEEPEST * length:
                wanted *= STEEPEST * length / size
                change = wanted - sideways
            if _norm(change) <= STALLED * length:
                break
            new = self._try(start, length, wanted, depth)
            jacobian = _updated(jacobian, change, step.residual, new.residual)
            sideways, step = wanted, new
        begin = slope * length
        turning = smallest_turning(
            lambda across: self._try(start, length, across, depth).residual, begin, length
        )
        raise NoEquilibriumError(not_found(length, last, turning, step.cutting_force))

    def solve_to(
        self, last: Vector, depth: float, length: float, rate: float
    ) -> TipSolution | None:
        """Find the step that ends at a depth: its length together with its direction.

        Broyden's method for both. None: not found from this guess.

        Parameters
        ----------
        last : array, shape (dim,), m
            Material point at the tip now.
        depth : float, m
            Where the step ends.
        length : float, m
            Guess; a march nearby knows a better one.
        rate : float
            Depth gained over length, about.
        """
        start, slope = _Start(last, self._instrument.axis), self._slope
        number, known = len(self._guide.learnt), self._guide.guess_last()
        if known is None:
            jacobian = np.eye(len(slope) + 1)
            jacobian[0, 0], jacobian[1:, 1:] = rate, length * self._jacobian
            unknown = np.append(length, slope)
        else:
            jacobian = known.derivatives
            unknown = np.append(known.length, slope + known.turned)
        error = change = np.zeros(0)
        for _ in range(FEW_ITERATIONS):
            sideways = unknown[0] * unknown[1:]
            if not 0.0 < unknown[0] <= self._instrument.spacing or (
                sideways @ sideways > (STEEPEST * unknown[0]) ** 2
            ):
                return None
            step = self._try(start, float(unknown[0]), sideways, None)
            reached = np.append(step.depth - depth, step.residual)
            if len(change):
                wrong = reached - error - jacobian @ change
                jacobian = jacobian + wrong[:, None] * (change / (change @ change))
            error = reached
            if abs(error[0]) <= ROUND_OFF and abs(error[1:]).max() <= TOLERANCE:
                turned = step.slope - slope
                self._guide.last = LastStep(number, float(unknown[0]), turned, jacobian)
                return step if jacobian[0, 0] > 0.0 else None
            change = -solved(jacobian, error)
            unknown = unknown + change
        return None

    def _try(
        self, start: "_Start", length: float, sideways: Floats, depth: float | None
    ) -> TipSolution:
        """Put the tip `length` further along the path, `sideways` of it across the axis."""
        self.evaluations += 1
        instrument, axis = self._instrument, self._instrument.axis
        last, forward = start.point, math.sqrt(length**2 - sideways @ sideways)
        tip = last + forward * axis.direction + sideways @ axis.lateral_directions
        weights = instrument.tip_and_piece(tip, last)
        trial = self._contact.trial(weights)
        limit, friction = instrument.resistance(weights)
        friction *= length
        hold = 1.0 / (instrument.lateral_penalty * length)
        before, here = start.offset, start.offset + sideways
        offset = 0.5 * (here + before)
        lateral, moved = _eliminated(trial, friction, offset, hold)
        ahead = start.along + forward
        force = limit if depth is None else float((depth - ahead - moved[0, 0]) / moved[0, 1])
        return TipSolution(
            tip=tip,
            trial=trial,
            depth=ahead + float(moved[0, 0] + force * moved[0, 1]),
            tip_force=force,
            cutting_force=limit,
            friction=friction,
            lateral=lateral[:, 0] + force * lateral[:, 1],
            offset=offset,
            compliance=hold,
            residual=here + moved[1:, 0] + force * moved[1:, 1],
            slope=sideways / length,
        )


class _Start:
    """Where a step starts: a material point, its offset from the axis and its place along it."""

    def __init__(self, point: Vector, axis: InsertionAxis) -> None:
        self.point, self.offset = point, axis.lateral_offset(point)
        self.along = float(axis.axial_coordinate(point))


def _eliminated(
    trial: ContactTrial, friction: float, offset: Floats, hold: float
) -> tuple[Floats, Floats]:
    """Return the piece's lateral force and the tip's displacement when the piece is held.

    Shapes (dim - 1, 2) and (dim, 2). Columns: constant part, and part per unit of tip force.
    """
    compliance, dim = trial.compliance, len(offset) + 1
    if dim == 2:  # one number is left to solve for: arrays would cost more than all the rest
        (c00, _, c02, c03), (c10, _, c12, c13), _, (c30, _, c32, c33) = compliance.tolist()
        d0, d1, _, d3 = trial.displacement.tolist()
        held = -1.0 / (c33 + hold)
        push, rate = held * (d3 + friction * c32 + float(offset[0])), held * c30
        along = d0 + friction * c02 + c03 * push, c00 + c03 * rate
        across = d1 + friction * c12 + c13 * push, c10 + c13 * rate
        return np.array([[push, rate]]), np.array([along, across])
    parts = compliance[:, [dim, 0]]
    parts[:, 0] = trial.displacement + friction * parts[:, 0]
    rhs = parts[dim + 1 :].copy()
    rhs[:, 0] += offset
    stiff = compliance[dim + 1 :, dim + 1 :] + hold * np.eye(dim - 1)
    lateral: Floats = -np.linalg.solve(stiff, rhs).astype(float)
    return lateral, parts[:dim] + compliance[:dim, dim + 1 :] @ lateral


def _largest(values: Floats) -> float:
    """Return the largest absolute value of an array of the size of the lateral directions."""
    return float(max(map(abs, values.tolist())))


def _norm(values: Floats) -> float:
    """Return the Euclidean norm of an array of that size."""
    return math.hypot(*values.tolist())


def _updated(jacobian: Floats, change: Floats, before: Floats, after: Floats) -> Floats:
    """Return derivatives that agree with the last change of residuals (Broyden's update)."""
    if len(change) == 1:  # the secant: arrays would cost more than the arithmetic
        known, moved = float(jacobian[0, 0]), float(change[0])
        wrong = float(after[0]) - float(before[0]) - known * moved
        return np.array([[known + wrong * (moved / (moved * moved))]])
    error = after - before - jacobian @ change
    found: Floats = jacobian + error[:, None] * (change / (change @ change))
    return found


def solved(matrix: Floats, rhs: Floats) -> Floats:
    """Solve a small system; one equation is all that lateral directions in the plane need."""
    if len(matrix) == 1:
        return rhs / float(matrix[0, 0])
    return np.linalg.solve(matrix, rhs).astype(float)
