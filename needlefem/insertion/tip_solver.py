"""One step of path following: material point at the tip, depth, and their initial values."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem._root_finding import broyden
from needlefem.contact.condensed_contact import CondensedContact, ContactTrial
from needlefem.fem.interpolation import OutsideError
from needlefem.mesh.surface import place_text
from needlefem.needle.needle_interface import InsertionAxis, NeedleInterface

Learnt = tuple[Floats, Floats]
"""Slope of the path in a step, shape (dim - 1,), and the derivative of the lateral distance of the
tip from the axis with respect to the slope, shape (dim - 1, dim - 1)."""


class WarmStart:
    """Initial values for the steps of an insertion, from an insertion with a nearby entry.

    Parameters
    ----------
    entry : array, shape (dim,), m
        Entry of the needle.
    expected : sequence of (slope, derivative)
        Values of the steps of the earlier insertion; may be empty.
    expected_last : LastStep, optional
        Last step of the earlier insertion.

    Attributes
    ----------
    learnt : list of (slope, derivative)
        Values of the steps so far.
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
        """Return the initial values for the next insertion; none unless its entry is near (m)."""
        apart = float(np.linalg.norm(entry - self.entry))
        return WarmStart(entry, self.learnt, self.last) if apart <= near else WarmStart(entry)

    def guess(self, slope: Floats, jacobian: Floats) -> Learnt:
        """Return slope and derivative to begin the next step with, given those of the last step."""
        number = len(self.learnt)
        if not 0 < number < len(self._expected):
            return slope, jacobian
        (then, _), (now, known) = self._expected[number - 1 : number + 1]
        return slope + now - then, known

    def guess_last(self) -> "LastStep | None":
        """Return the last step of the earlier insertion, if the next step has the same number."""
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
        Its slope minus that of the step before.
    derivatives : array, shape (dim, dim)
        Derivatives of depth and lateral distance, m, with respect to length, m, and slope.
    """

    number: int
    length: float
    turned: Floats
    derivatives: Floats


# One step along the cut path: the next material point at the tip, and the depth.


TOLERANCE = 1e-12
"""Tolerance of the lateral distance of the tip from the axis, m."""
STALLED = 1e-15
"""Change of the slope below which the iteration ends."""
STEEPEST = 0.9
"""Largest sine of the angle between a step and the needle axis."""
MOST_ITERATIONS = 40
ROUND_OFF = 1e-14
"""Tolerance of the depth of the last step, m."""
LEAST_TURNING = 0.25
"""Derivative of the lateral tip position with respect to that on the path below which the step is
assumed to have no equilibrium."""
DIFFERENCE = 0.05
"""Lateral increment for this derivative, over the length of the step."""
PLANE = 2
FEW_ITERATIONS = 10
"""Iterations of a step with unknown length; five suffice with good initial values."""


class TipSolution(NamedTuple):
    """A step that satisfies the axial equations.

    Parameters
    ----------
    tip : array, shape (dim,), m
        Material point at the tip.
    trial : ContactTrial
        Functionals of the step: the tip kernel, and the contact segment behind it.
    depth : float, m
    tip_force, cutting_force : float, N (N/m in 2D)
        Axial force of the tip, and the force at which it cuts at this material point.
    friction : float, N (N/m in 2D)
        Friction force on the segment.
    lateral : array, shape (dim - 1,), N (N/m in 2D)
        Lateral force on the segment.
    offset : array, shape (dim - 1,), m
        Lateral offset of the undeformed segment from the axis.
    compliance : float, m/N
        Compliance of the lateral penalty of the segment.
    residual : array, shape (dim - 1,), m
        Lateral distance of the tip from the axis.
    slope : array, shape (dim - 1,)
        Lateral component of the step over its length.
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
        """Forces on the functionals of the trial."""
        none = np.zeros_like(self.lateral)
        return np.concatenate([[self.tip_force], none, [self.friction], self.lateral])

    @property
    def excess(self) -> float:
        """Tip force minus cutting force, N (N/m in 2D)."""
        return self.tip_force - self.cutting_force


class NoEquilibriumError(Exception):
    """No equilibrium was found for a step of this length."""


def not_found(length: float, last: Vector, turning: float, limit: float) -> str:
    """Return the error message for a step without equilibrium.

    Parameters
    ----------
    length : float, m
        Length of the step.
    last : array, shape (dim,), m
        Material point at which the step begins.
    turning : float
        Derivative of the lateral position of the tip with respect to its lateral position on the
        path, at the initial slope. It is 1 in rigid tissue. If it is 0, the strained tissue has
        lost its resistance to a lateral motion of the tip.
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
    """Return the smallest derivative of the lateral tip position with respect to that on the path.

    Parameters
    ----------
    beside : callable
        Takes the lateral position of the tip on the path, shape (dim - 1,), m; returns its lateral
        distance from the axis, of the same shape.
    sideways : array, shape (dim - 1,), m
        Lateral position at which the derivative is taken.
    length : float, m
        Length of the step, which scales the finite differences.

    Returns
    -------
    Real part of the smallest eigenvalue; NaN if there is no tissue around the tip.
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
    """Computes steps from the end of the path; each step gives initial values for the next.

    Parameters
    ----------
    instrument : NeedleInterface
    contact : CondensedContact
        Contact segments of the path so far.
    warm_start : WarmStart, optional
        Initial values from an insertion with a nearby entry.
    """

    def __init__(
        self,
        instrument: NeedleInterface,
        contact: CondensedContact,
        warm_start: WarmStart | None = None,
    ) -> None:
        self._instrument, self.contact = instrument, contact
        self._warm_start = warm_start or WarmStart(instrument.axis.entry)
        lateral = len(instrument.axis.lateral_directions)
        self._slope = np.zeros(lateral)
        self._jacobian = np.eye(lateral)
        self.evaluations = 0

    def follow(self, step: TipSolution) -> None:
        """Store the slope of an accepted step as initial value of the next."""
        self._slope = step.slope
        self._warm_start.learnt.append((self._slope, self._jacobian))

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
        """Solve for the step whose tip is on the axis (Broyden's method; the secant method in 2D).

        Parameters
        ----------
        last : array, shape (dim,), m
            Material point at the tip before the step.
        length : float, m
            Length of the step.
        depth : float, m, optional
            If given, the tip force is that which keeps the tip at this depth. If not, the tip force
            is the cutting force, and the depth is a result.
        begin : array, shape (dim - 1,), optional
            Initial slope; extrapolated from earlier steps when left out.
        tolerance : float, m
            Tolerance of the lateral distance of the tip from the axis.

        Raises
        ------
        NoEquilibriumError
        """
        start = _Start(last, self._instrument.axis)
        slope, jacobian = begin, self._jacobian
        if slope is None:
            slope, jacobian = self._warm_start.guess(self._slope, jacobian)
        steep = math.sqrt(slope @ slope)
        if steep > STEEPEST:  # an extrapolated slope may exceed 1
            slope = slope * (STEEPEST / steep)
        largest = STEEPEST * length

        def evaluate(sideways: Floats) -> tuple[TipSolution, Floats]:
            step = self._try(start, length, sideways, depth)
            return step, step.residual

        def limit(sideways: Floats, change: Floats) -> Floats:
            target = sideways + change
            size = math.hypot(*target.tolist())
            return target * (largest / size) - sideways if size > largest else change

        root = broyden(
            evaluate,
            slope * length,
            jacobian,
            tolerance=tolerance,
            smallest_change=STALLED * length,
            iterations=MOST_ITERATIONS,
            limit=limit,
        )
        if root is not None:
            self._jacobian = root.jacobian
            return root.solution
        begin = slope * length
        turning = smallest_turning(lambda sideways: evaluate(sideways)[1], begin, length)
        cutting_force = evaluate(begin)[0].cutting_force
        raise NoEquilibriumError(not_found(length, last, turning, cutting_force))

    def solve_to(
        self, last: Vector, depth: float, length: float, rate: float
    ) -> TipSolution | None:
        """Solve for the length and the slope of a step that ends at a depth (Broyden's method).

        Parameters
        ----------
        last : array, shape (dim,), m
            Material point at the tip before the step.
        depth : float, m
            Depth at the end of the step.
        length : float, m
            Initial length, unless an insertion with a nearby entry gives a better one.
        rate : float
            Approximate depth gained per length.

        Returns
        -------
        The step, or None if the iteration does not converge from these initial values.
        """
        start, slope = _Start(last, self._instrument.axis), self._slope
        number, known = len(self._warm_start.learnt), self._warm_start.guess_last()
        if known is None:
            jacobian = np.eye(len(slope) + 1)
            jacobian[0, 0], jacobian[1:, 1:] = rate, length * self._jacobian
            unknown = np.append(length, slope)
        else:
            jacobian = known.derivatives
            unknown = np.append(known.length, slope + known.turned)

        def evaluate(unknown: Floats) -> tuple[TipSolution, Floats] | None:
            sideways = unknown[0] * unknown[1:]
            if not 0.0 < unknown[0] <= self._instrument.spacing or (
                sideways @ sideways > (STEEPEST * unknown[0]) ** 2
            ):
                return None
            step = self._try(start, float(unknown[0]), sideways, None)
            return step, np.append(step.depth - depth, step.residual)

        root = broyden(
            evaluate,
            unknown,
            jacobian,
            tolerance=(ROUND_OFF, *[TOLERANCE] * len(slope)),
            smallest_change=0.0,
            iterations=FEW_ITERATIONS,
        )
        if root is None:
            return None
        turned = root.solution.slope - slope
        self._warm_start.last = LastStep(number, float(root.unknowns[0]), turned, root.jacobian)
        return root.solution if root.jacobian[0, 0] > 0.0 else None

    def _try(
        self, start: "_Start", length: float, sideways: Floats, depth: float | None
    ) -> TipSolution:
        """Return the step of a length whose lateral component is `sideways`."""
        self.evaluations += 1
        instrument, axis = self._instrument, self._instrument.axis
        last, forward = start.point, math.sqrt(length**2 - sideways @ sideways)
        tip = last + forward * axis.direction + sideways @ axis.lateral_directions
        weights = instrument.tip_and_segment(tip, last)
        trial = self.contact.trial(weights)
        limit, friction = instrument.resistance(weights)
        friction *= length
        penalty = 1.0 / (instrument.lateral_penalty * length)
        before, here = start.offset, start.offset + sideways
        offset = 0.5 * (here + before)
        lateral, moved = _eliminated(trial, friction, offset, penalty)
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
            compliance=penalty,
            residual=here + moved[1:, 0] + force * moved[1:, 1],
            slope=sideways / length,
        )


class _Start:
    """Start of a step: a material point, its lateral offset and its axial coordinate."""

    def __init__(self, point: Vector, axis: InsertionAxis) -> None:
        self.point, self.offset = point, axis.lateral_offset(point)
        self.along = float(axis.axial_coordinate(point))


def _eliminated(
    trial: ContactTrial, friction: float, offset: Floats, penalty: float
) -> tuple[Floats, Floats]:
    """Eliminate the lateral force of the new segment.

    Returns
    -------
    Lateral force on the segment, shape (dim - 1, 2), and displacement of the tip, shape (dim, 2).
    The columns are the constant part and the part per unit of tip force.
    """
    compliance, dim = trial.compliance, len(offset) + 1
    if dim == 2:  # one unknown: arrays would cost more than the rest of the computation
        (c00, _, c02, c03), (c10, _, c12, c13), _, (c30, _, c32, c33) = compliance.tolist()
        d0, d1, _, d3 = trial.displacement.tolist()
        inverse = -1.0 / (c33 + penalty)
        push, rate = inverse * (d3 + friction * c32 + float(offset[0])), inverse * c30
        along = d0 + friction * c02 + c03 * push, c00 + c03 * rate
        across = d1 + friction * c12 + c13 * push, c10 + c13 * rate
        return np.array([[push, rate]]), np.array([along, across])
    parts = compliance[:, [dim, 0]]
    parts[:, 0] = trial.displacement + friction * parts[:, 0]
    rhs = parts[dim + 1 :].copy()
    rhs[:, 0] += offset
    matrix = compliance[dim + 1 :, dim + 1 :] + penalty * np.eye(dim - 1)
    lateral: Floats = -np.linalg.solve(matrix, rhs).astype(float)
    return lateral, parts[:dim] + compliance[:dim, dim + 1 :] @ lateral
