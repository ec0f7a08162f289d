"""Time integration of the tissue: ``M a + C v + K u = f``."""

import dataclasses

import numpy as np

from needlefem.arrays import Floats, Sparse
from needlefem.errors import CaseError
from needlefem.fem.factor import Factor, factorise
from needlefem.fem.model import Model


@dataclasses.dataclass(frozen=True, kw_only=True)
class Newmark:
    """Newmark's method (N. M. Newmark, J. Eng. Mech. Div. ASCE 85, 1959).

    ``beta = 1/4, gamma = 1/2`` is the average acceleration: second order, unconditionally
    stable, no damping of its own. ``gamma > 1/2`` damps, at first order.
    """

    beta: float = 0.25
    gamma: float = 0.5

    def __post_init__(self) -> None:
        if self.gamma < 0.5 or 2.0 * self.beta < self.gamma:
            problem = f"beta {self.beta:g}, gamma {self.gamma:g} are not unconditionally stable"
            raise CaseError("newmark", problem, "keep 2 beta >= gamma >= 1/2")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Damping:
    """Rayleigh damping ``C = mass_rate M + stiffness_time K``, in 1/s and s."""

    mass_rate: float = 0.0
    stiffness_time: float = 0.0


@dataclasses.dataclass(eq=False)
class Motion:
    """Displacement, velocity and acceleration of the free dofs; each of shape (nfree,)."""

    u: Floats
    v: Floats
    a: Floats


class TissueDynamics:
    """The step of one integrator, one time step and one tissue: a single factorisation.

    Contact sees only the operator A (through `factor`), what the tissue would do without it
    (`free_motion`), and how velocity follows from displacement (`advance`).

    Parameters
    ----------
    model : Model
    step : float, s
    newmark : Newmark
    damping : Damping
    lumping : str, optional
        A lumping that the element admits; consistent mass when left out.

    Raises
    ------
    CaseError
        The tissue has no mass somewhere.
    """

    def __init__(
        self,
        model: Model,
        step: float,
        newmark: Newmark | None = None,
        damping: Damping | None = None,
        lumping: str | None = None,
    ) -> None:
        if model.density.min() <= 0.0:
            remedy = "give every material a density, or simulate quasi-statically"
            raise CaseError("materials", "a material without density has no dynamics", remedy)
        self.model, self.step = model, step
        self.newmark = newmark or Newmark()
        whole = _mass(model, lumping)
        self.damping = damping or Damping()
        beta, gamma, dt = self.newmark.beta, self.newmark.gamma, step
        drag = gamma / (beta * dt)
        inertia = 1.0 / (beta * dt**2) + drag * self.damping.mass_rate
        self.factor: Factor = model.stiffness.factor(
            model.free_dofs, 1.0 + drag * self.damping.stiffness_time, inertia * whole
        )
        self.mass: Sparse = model.free_block(whole).tocsr()

    def _drag(self, velocity: Floats) -> Floats:
        """Return C v on the free dofs."""
        found: Floats = self.damping.mass_rate * (self.mass @ velocity)
        if self.damping.stiffness_time:
            found = found + self.damping.stiffness_time * self.elastic_force(velocity)
        return found

    def elastic_force(self, u: Floats) -> Floats:
        """Return K u on the free dofs, shape (nfree,), N (N/m in 2D)."""
        whole = np.zeros(self.model.ndofs)
        whole[self.model.free_dofs] = u
        found: Floats = self.model.stiffness.force(whole)[self.model.free_dofs]
        return found

    def at_rest(self) -> Motion:
        """Return the undeformed tissue at rest."""
        zero = np.zeros(len(self.model.free_dofs))
        return Motion(zero, zero.copy(), zero.copy())

    def start(self, u: Floats, v: Floats) -> Motion:
        """Return the motion that starts from a displacement and velocity without forces."""
        a = factorise(self.mass).solve(-(self.elastic_force(u) + self._drag(v)))
        return Motion(u.copy(), v.copy(), a)

    def free_motion(self, motion: Motion, force: Floats | None = None) -> Floats:
        """Return the displacement after a step without contact, shape (nfree,), m."""
        beta, gamma, dt = self.newmark.beta, self.newmark.gamma, self.step
        u, v, a = motion.u, motion.v, motion.a
        inertia = u / (beta * dt**2) + v / (beta * dt) + (0.5 / beta - 1.0) * a
        rhs = self.mass @ inertia
        if self.damping != Damping():
            drag = gamma / (beta * dt) * u + (gamma / beta - 1.0) * v
            rhs += self._drag(drag + dt * (0.5 * gamma / beta - 1.0) * a)
        if force is not None:
            rhs += force
        return self.factor.solve(rhs)

    def advance(self, motion: Motion, u: Floats) -> Motion:
        """Return the motion after a step that ends at a displacement."""
        beta, gamma, dt = self.newmark.beta, self.newmark.gamma, self.step
        predicted = motion.u + dt * motion.v + dt**2 * (0.5 - beta) * motion.a
        a = (u - predicted) / (beta * dt**2)
        v = motion.v + dt * ((1.0 - gamma) * motion.a + gamma * a)
        return Motion(u, v, a)

    def energy(self, motion: Motion) -> float:
        """Return kinetic plus strain energy, J (J/m in 2D)."""
        kinetic = 0.5 * float(motion.v @ (self.mass @ motion.v))
        whole = np.zeros((self.model.ndofs, 1))
        whole[self.model.free_dofs, 0] = motion.u
        return kinetic + float(self.model.stiffness.energy(whole)[0])


def _mass(model: Model, lumping: str | None) -> Sparse:
    if lumping is None:
        return model.mass
    from scipy.sparse import diags_array  # noqa: PLC0415  (only a lumped mass needs it)

    return diags_array(model.lumped_mass(lumping)).tocsr()
