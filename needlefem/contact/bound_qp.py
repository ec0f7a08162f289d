"""A convex quadratic potential under bounds: what sticks and what slips.

Friction between its limits, and a tip that presses between nothing and the cutting force, are
the minimiser of ``z.S z / 2 - d.z`` over ``low <= z <= high``: what is inside its bounds sticks
(the gradient vanishes), what is at a bound slips the way the gradient says. A semismooth Newton
method with line search on the potential changes many at once (D. P. Bertsekas 1982). Where
forces hardly differ in their effect it takes short steps; then an active set changes one at a
time, which ends for certain, since the potential falls and no set comes back (J. Nocedal,
S. J. Wright 2006, section 16.5).
"""

import numpy as np
from scipy.linalg.lapack import dposv

from needlefem._arrays import Bools, Floats
from needlefem.errors import SimulationError

ROUND_OFF = 1e-14
"""Of the gradient, relative to the largest of its terms and times their number."""
UNTOLD = (
    "the tissue can't tell apart what sticks: the path's pieces are too short for the mesh; "
    "lengthen discretisation.path_spacing or give needle.stick_stiffness"
)
NEWTON_STEPS = 12
MOST_HALVINGS = 12


class _Problem:
    def __init__(self, matrix: Floats, linear: Floats, low: Floats, high: Floats) -> None:
        self.matrix, self.linear, self.low, self.high = matrix, linear, low, high
        self._loose = low < high
        self.noise = 0.0

    def inside(self, z: Floats) -> Bools:
        return (z > self.low) & (z < self.high)

    def look(self, z: Floats) -> tuple[Floats, Bools]:
        """Return the gradient, and what it pulls off a bound."""
        push = self.matrix @ z
        gradient = push - self.linear
        self.noise = ROUND_OFF * len(z) * float(np.abs(push).max() + np.abs(self.linear).max())
        off_low = (z <= self.low) & (gradient < -self.noise)
        off_high = (z >= self.high) & (gradient > self.noise)
        return gradient, (off_low | off_high) & self._loose

    def newton(self, gradient: Floats, free: Bools) -> Floats:
        """Return the step to the minimum over what is free."""
        step, where = np.zeros_like(gradient), np.flatnonzero(free)
        if where.size:
            part = self.matrix[where[:, None], where]
            _, found, trouble = dposv(part, -gradient[where], lower=1, overwrite_a=1)
            if trouble:
                raise SimulationError(UNTOLD)
            step[where] = found
        return step

    def descend(self, z: Floats, gradient: Floats, step: Floats) -> Floats:
        """Return the point along the step, projected onto the bounds, where the potential falls."""
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
        Symmetric, positive definite on what is not fixed by equal bounds.
    linear, low, high, start : arrays, shape (n,)
        Bounds may be infinite; `start` need not be within them.

    Raises
    ------
    SimulationError
        Round-off hides the minimum.
    """
    problem = _Problem(matrix, linear, low, high)
    z = np.clip(start, low, high)
    for _ in range(NEWTON_STEPS):
        gradient, pulled = problem.look(z)
        free = problem.inside(z) | pulled
        if not free.any() or np.max(np.abs(gradient[free])) <= problem.noise:
            return z
        z = problem.descend(z, gradient, problem.newton(gradient, free))
    return _one_by_one(problem, z)


def _one_by_one(problem: _Problem, z: Floats) -> Floats:
    """Return the minimiser by an active set."""
    free = problem.inside(z)
    for _ in range(20 * len(z) + 100):
        gradient, pulled = problem.look(z)
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
        gradient, pulled = problem.look(z)
        if not pulled.any():
            return z
        free[int(np.argmax(np.where(pulled, np.abs(gradient), 0.0)))] = True
    raise SimulationError("no state of stick and slip found; the path's pieces are too short")
