"""Friction of the shaft: a bound-constrained quadratic programme, and limits that weaken with slip.

Friction forces within their limits and a tip force between zero and the cutting force minimise
``z.S z / 2 - d.z`` over ``low <= z <= high``. A force inside its bounds belongs to a sticking
segment (the gradient is zero); a force at a bound belongs to a segment that slips in the direction
of the gradient. `solve_bound_qp` uses a semismooth Newton method with a line search on the
potential, which changes many constraints at once (D. P. Bertsekas 1982). If the compliance is
nearly singular, its steps become short. An active-set method then changes one constraint at a
time. It always terminates, because the potential decreases and no active set occurs twice
(J. Nocedal, S. J. Wright 2006, section 16.5).

`SlipWeakeningFriction` is the friction limit as a function of slip, and `FrictionStep` the return
mapping of one step.
"""

import dataclasses

import numpy as np
from scipy.linalg.lapack import dposv

from needlefem._arrays import Bools, Floats
from needlefem.errors import SimulationError

ROUND_OFF = 1e-14
"""Round-off of the gradient, relative to its largest term times the number of terms."""
UNRESOLVED = (
    "the friction forces of sticking contact segments cannot be resolved: the segments are too "
    "short for the mesh; lengthen discretization.path_spacing or set needle.tangential_penalty"
)
"""Error message for forces that are dominated by round-off."""
NEWTON_STEPS = 12
"""Iterations of Newton's method before the active-set method is used."""
MOST_HALVINGS = 12
"""Largest number of halvings in the line search."""


class _Problem:
    """The quadratic programme of `solve_bound_qp`."""

    def __init__(self, matrix: Floats, linear: Floats, low: Floats, high: Floats) -> None:
        self.matrix, self.linear, self.low, self.high = matrix, linear, low, high
        self._not_fixed = low < high
        self.noise = 0.0

    def inside(self, z: Floats) -> Bools:
        """Return which unknowns are strictly between their bounds."""
        return (z > self.low) & (z < self.high)

    def gradient(self, z: Floats) -> tuple[Floats, Bools]:
        """Return the gradient, and whether it points from an active bound into the interval."""
        push = self.matrix @ z
        gradient = push - self.linear
        self.noise = ROUND_OFF * len(z) * float(np.abs(push).max() + np.abs(self.linear).max())
        off_low = (z <= self.low) & (gradient < -self.noise)
        off_high = (z >= self.high) & (gradient > self.noise)
        return gradient, (off_low | off_high) & self._not_fixed

    def newton(self, gradient: Floats, free: Bools) -> Floats:
        """Return the step to the minimum over the free unknowns."""
        step, where = np.zeros_like(gradient), np.flatnonzero(free)
        if where.size:
            part = self.matrix[where[:, None], where]
            _, found, trouble = dposv(part, -gradient[where], lower=1, overwrite_a=1)
            if trouble:
                raise SimulationError(UNRESOLVED)
            step[where] = found
        return step

    def descend(self, z: Floats, gradient: Floats, step: Floats) -> Floats:
        """Return a point on the step, projected onto the bounds, with a sufficient decrease."""
        reached, share = z, 1.0
        for _ in range(MOST_HALVINGS):
            reached = np.clip(z + share * step, self.low, self.high)
            moved = reached - z
            falls = float(gradient @ moved)
            if falls + 0.5 * float(moved @ (self.matrix @ moved)) <= 1e-4 * falls:
                return reached
            share *= 0.5
        return z


# Kernel: convex quadratic programme with bounds, by an active set.
#     minimise  z.S z / 2 - d.z    over    low <= z <= high
#     free set F (inside its bounds):    S_FF step_F = d_F - (S z)_F,    then a line search
# z, low, high  forces and their bounds, N (N/m in 2D)
# S, d          symmetric positive compliance, m/N (m^2/N in 2D); displacement, m
# Source: projected Newton method, D. P. Bertsekas, SIAM J. Control Optim. 20 (1982) 221;
# active set: J. Nocedal, S. J. Wright, Numerical Optimization (2006), section 16.5.
def solve_bound_qp(
    matrix: Floats, linear: Floats, low: Floats, high: Floats, start: Floats
) -> Floats:
    """Return the minimiser of ``z.matrix z / 2 - linear.z`` within bounds.

    Parameters
    ----------
    matrix : array, shape (n, n)
        Symmetric; positive definite on the unknowns whose two bounds differ.
    linear, low, high, start : arrays, shape (n,)
        Bounds may be infinite; `start` need not be within them.

    Raises
    ------
    SimulationError
        The matrix is singular within round-off, or the active set does not converge.
    """
    problem = _Problem(matrix, linear, low, high)
    z = np.clip(start, low, high)
    for _ in range(NEWTON_STEPS):
        gradient, released = problem.gradient(z)
        free = problem.inside(z) | released
        if not free.any() or np.max(np.abs(gradient[free])) <= problem.noise:
            return z
        z = problem.descend(z, gradient, problem.newton(gradient, free))
    return _one_by_one(problem, z)


def _one_by_one(problem: _Problem, z: Floats) -> Floats:
    """Return the minimiser by a method that changes one active constraint at a time."""
    free = problem.inside(z)
    for _ in range(20 * len(z) + 100):
        gradient, released = problem.gradient(z)
        step = problem.newton(gradient, free)
        room = np.where(step > 0.0, problem.high - z, problem.low - z)
        shares = np.divide(room, step, out=np.full_like(z, np.inf), where=step != 0.0)
        first = int(np.argmin(shares))
        if shares[first] < 1.0:
            z = z + shares[first] * step
            z[first] = problem.high[first] if step[first] > 0.0 else problem.low[first]
            free[first] = False
            continue
        z = z + step
        gradient, released = problem.gradient(z)
        if not released.any():
            return z
        free[int(np.argmax(np.where(released, np.abs(gradient), 0.0)))] = True
    raise SimulationError(
        "no set of sticking and slipping contact segments satisfies the friction limits: the "
        "segments are too short for the mesh"
    )


MOST_WEAKENINGS = 500
"""Largest number of iterations of the friction limits."""
SETTLED = 1e-12
"""Relative change of the friction limits below which the iteration has converged."""
SINGULAR = 1e12
"""Condition number of the sticking segments' compliance above which round-off dominates."""
STUCK = 1e-13
"""Slip in a step that counts as zero, m."""


@dataclasses.dataclass(frozen=True)
class SlipWeakeningFriction:
    """Friction limit as a function of slip: static when sticking, kinetic after some slip.

    Parameters
    ----------
    ratio : float
        Ratio of the static limit to the kinetic limit.
    length : float, m
        Slip-weakening distance; 0: the limit drops at the first slip, within one time step.
    stiffness : float, Pa (N/m^3 in 2D)
        Tangential penalty: stiffness of sticking per length of path; 0: rigid.
    """

    ratio: float = 1.0
    length: float = 0.0
    stiffness: float = 0.0

    @property
    def weakens(self) -> bool:
        """Whether the limit depends on slip."""
        return self.ratio > 1.0

    # Kernel: slip weakening of the friction limit.
    #     tau(d) = tau_k (1 + (r - 1) max(1 - d / D_c, 0))
    # tau, tau_k  limit and kinetic limit of a segment, N (N/m in 2D)
    # r           static over kinetic limit
    # d, D_c      slip since the segment last stuck; slip-weakening distance, m
    # Source: linear slip weakening, Y. Ida, J. Geophys. Res. 77 (1972) 3796; docs/theory.md, (11).
    def limits(self, kinetic: Floats, slipped: Floats) -> Floats:
        """Return the limits for given slips since sticking (m); both of shape (n,)."""
        if not self.weakens:
            return kinetic
        left = 1.0 - slipped / self.length if self.length > 0.0 else 1.0 * (slipped <= 0.0)
        found: Floats = kinetic * (1.0 + (self.ratio - 1.0) * np.clip(left, 0.0, 1.0))
        return found

    def slack(self, lengths: Floats) -> Floats:
        """Return the compliance of sticking, m/N, of segments of given lengths (m)."""
        stiffness = self.stiffness * lengths
        return np.divide(1.0, stiffness, out=np.zeros_like(stiffness), where=stiffness > 0.0)


def stick_condition(compliance: Floats, slack: Floats) -> float:
    """Return the condition number of the sticking segments' compliance; 1e16 if it is singular.

    Parameters
    ----------
    compliance : array, shape (n, n), m/N
        Axial displacement of the segments per axial force.
    slack : array, shape (n,), m/N
        Compliance of the tangential penalty.
    """
    values = np.linalg.eigvalsh(compliance + np.diag(slack))
    return float(values[-1] / max(values[0], 1e-16 * values[-1]))


def refuse_noise(compliance: Floats, slack: Floats) -> None:
    """Raise a `SimulationError` if the friction forces of sticking segments cannot be resolved.

    Parameters are those of `stick_condition`.
    """
    if len(compliance) and stick_condition(compliance, slack) >= SINGULAR:
        raise SimulationError(UNRESOLVED)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FrictionStep:
    """Friction of the segments at the start of a step, and its return mapping.

    Parameters
    ----------
    friction : SlipWeakeningFriction
    kinetic : array, shape (n,), N (N/m in 2D)
        Kinetic friction limits.
    slipped : array, shape (n,), m
        Slip since the segment last stuck, at the start of the step.
    travel : array, shape (n,), m
        Displacement that a segment would have if it stuck to the needle during the step.
    old : array, shape (n,), N (N/m in 2D)
        Friction forces at the start of the step.
    lengths : array, shape (n,), m
        Lengths of the segments.
    lag : array, shape (n,), m, optional
        With inertia: distance by which a segment that had another velocity than the needle remains
        behind `travel` when it begins to stick.
    """

    friction: SlipWeakeningFriction
    kinetic: Floats
    slipped: Floats
    travel: Floats
    old: Floats
    lengths: Floats
    lag: Floats | None = None

    # Kernel: return mapping of friction and tip force over one step.
    #     minimise  z.S z / 2 - d.z    over    -tau <= z <= tau,    0 <= z_tip <= f_c
    # z    friction forces on the segments and axial force of the tip, N (N/m in 2D)
    # S    axial compliance after elimination of lateral forces, m/N (m^2/N in 2D)
    # d    displacement with which each functional would follow the needle, m
    # tau, f_c  friction limits and cutting force, N (N/m in 2D)
    # Source: G. Duvaut, J.-L. Lions, Les inequations en mecanique et en physique (1972); (10).
    def solve(
        self,
        compliance: Floats,
        free: Floats,
        start: Floats,
        tip: tuple[float, float, float] | None = None,
    ) -> tuple[Floats, Floats, Floats]:
        """Return the forces, the slip of the segments, and the gap between needle and tissue.

        If several solutions exist, the one with the most sticking is returned: the iteration
        starts with the limits at the start of the step and reduces them according to the slip
        until they do not change any more.

        Parameters
        ----------
        compliance : array, shape (n, n) or (n + 1, n + 1), m/N
            Axial displacement of the segments, and of the tip, per axial force.
        free : array, shape as its rows, m
            Axial displacement without axial forces.
        start : array, shape as its rows, N
            Initial guess of the forces.
        tip : (float, float, float), optional
            Bounds of the tip force (N); displacement of the tip if it moved with the needle (m).

        Returns
        -------
        Forces, N (N/m in 2D); slip of the segments in the step, m, exactly zero if they stick;
        difference between the displacements of needle and tissue for all rows, m.

        Raises
        ------
        SimulationError
            The friction limits do not converge.
        """
        slack = self.friction.slack(self.lengths)
        lag = 0.0 if self.lag is None else self.lag
        travel = self.travel + slack * self.old - lag
        bottom, top = np.zeros(len(free)), np.zeros(len(free))
        if tip is not None:
            slack, travel = np.append(slack, 0.0), np.append(travel, tip[2])
            bottom[-1], top[-1] = tip[:2]
        count = len(self.kinetic)
        matrix = compliance + np.diag(slack) if slack.any() else compliance
        forces, slip = start, np.zeros(count)
        limits = self._limits(slip)
        for _ in range(MOST_WEAKENINGS):
            bottom[:count], top[:count] = -limits[1], limits[0]
            forces = solve_bound_qp(matrix, travel - free, bottom, top, forces)
            apart = travel - free - matrix @ forces
            inside = (forces > bottom) & (forces < top)
            still = inside[:count] | (np.abs(apart[:count]) <= STUCK)
            slip = np.where(still, 0.0, np.copysign(apart[:count] + lag, apart[:count]))
            weaker = self._limits(slip)
            if np.all(np.abs(limits - weaker) <= SETTLED * limits):
                return forces, slip, apart
            limits = self._weakened(limits, weaker, slip, inside, matrix)
        raise SimulationError("slip weakening does not converge in this step; take shorter steps")

    def _weakened(
        self, limits: Floats, weaker: Floats, slip: Floats, inside: Bools, matrix: Floats
    ) -> Floats:
        """Return limits that are closer to those that follow from their own slip.

        Segments that slip and still weaken are updated by Newton's method, with the others
        unchanged. If the step would not reduce the residual, the limits of all slipping segments
        are set to the values that follow from the present slip.
        """
        direction = np.where(slip < 0.0, 1, 0)
        segments = np.arange(len(slip))
        weakening = (slip != 0.0) & (weaker[direction, segments] > self.kinetic * (1.0 + SETTLED))
        moving = np.flatnonzero(weakening)
        if not moving.size or self.friction.length <= 0.0:
            return weaker
        stuck = np.flatnonzero(inside)
        compliance = matrix[np.ix_(moving, moving)]
        if stuck.size:
            cross = matrix[np.ix_(stuck, moving)]
            compliance = compliance - cross.T @ np.linalg.solve(matrix[np.ix_(stuck, stuck)], cross)
        sign = np.sign(slip[moving])
        rate = self.kinetic[moving] * (self.friction.ratio - 1.0) / self.friction.length
        jacobian = np.eye(len(moving)) - rate[:, None] * (sign[:, None] * compliance * sign)
        residual = (limits - weaker)[direction[moving], moving]
        step = np.linalg.solve(jacobian, residual)
        found = weaker.copy()
        if np.all(step * np.sign(residual) >= 0.0) and np.all(np.abs(step) >= np.abs(residual)):
            reached = limits[direction[moving], moving] - step
            found[direction[moving], moving] = np.maximum(reached, self.kinetic[moving])
        return found

    def _limits(self, slip: Floats) -> Floats:
        """Return the limits for both directions after slip in the step, shape (2, n).

        A segment that reverses its direction sticks in between, so that its limit starts at the
        static value again.
        """
        onward = np.where(self.old >= 0.0, self.slipped, 0.0)
        back = np.where(self.old < 0.0, self.slipped, 0.0)
        forward, backward = np.maximum(slip, 0.0), np.maximum(-slip, 0.0)
        return np.stack(
            [
                self.friction.limits(self.kinetic, onward + forward),
                self.friction.limits(self.kinetic, back + backward),
            ]
        )

    def after(self, slip: Floats) -> Floats:
        """Return the slip since sticking at the step's end, shape (n,), m."""
        went_on = (slip >= 0.0) == (self.old >= 0.0)
        before = np.where(went_on, self.slipped, 0.0)
        found: Floats = np.where(slip == 0.0, 0.0, np.abs(slip) + before)
        return found
