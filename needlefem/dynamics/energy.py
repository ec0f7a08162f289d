"""Energy balance of a motion; each term is computed from its own definition."""

import dataclasses

from needlefem._arrays import Floats
from needlefem.dynamics.steppers import AlphaParameters, KinematicState, StaticStepper, Stepper
from needlefem.dynamics.system import MaxwellUpdate, System


def kinetic_energy(system: System, v: Floats) -> float:
    """Return the kinetic energy of a velocity, J."""
    return 0.5 * float(v @ system.mass_times(v))


@dataclasses.dataclass
class TissueEnergyBalance:
    """Work of the external forces and the energies that it was converted to, J (J/m in 2D).

    In each step the force is taken as the mean of the forces at its ends. `kinetic`, `strain` and
    `stored` (in the springs of viscoelastic branches) are increases since the start; `damping` and
    `relaxation` are viscous losses; `algorithmic` is the dissipation of the integrator (see
    `_algorithmic`), which is zero for the average acceleration. `total_absolute_work` is the sum of
    the absolute work of all steps. No term is computed as a difference of the others, so that an
    error in any of them appears in `residual`.

    For a stepper that is not a member of the generalised-alpha family (one without `weights`) no
    `algorithmic` term is computed: its dissipation is contained in `residual`.
    """

    stepper: Stepper
    work: float = 0.0
    total_absolute_work: float = 0.0
    kinetic: float = 0.0
    strain: float = 0.0
    stored: float = 0.0
    damping: float = 0.0
    relaxation: float = 0.0
    algorithmic: float = 0.0

    def __post_init__(self) -> None:
        self._memory = MaxwellUpdate(self.stepper.system.branches, self.stepper.step)
        self._weights: AlphaParameters | None = getattr(self.stepper, "weights", None)

    def add(
        self,
        old: KinematicState,
        new: KinematicState,
        before: Floats,
        after: Floats,
        *,
        at_once: bool = False,
    ) -> None:
        """Add the terms of one step.

        Parameters
        ----------
        old, new : KinematicState
            At the start and at the end of the step.
        before, after : arrays, shape (n,), N
            Forces at these times.
        at_once : bool
            Both states belong to the end of the same quasi-static step, before and after a sudden
            change of the force.
        """
        system, moved = self.stepper.system, new.u - old.u
        work = 0.5 * float((before + after) @ moved)
        self.work += work
        self.total_absolute_work += abs(work)
        self.strain += system.strain_energy(new.u) - system.strain_energy(old.u)
        if not isinstance(self.stepper, StaticStepper):
            self.kinetic += kinetic_energy(system, new.v) - kinetic_energy(system, old.v)
            if system.damped:
                mean = 0.5 * (old.v + new.v)
                self.damping += float(system.products(None, mean, None) @ moved)
        if self._memory:
            self.stored += self._memory.energy(new.parts) - self._memory.energy(old.parts)
            self.relaxation += self._memory.lost(old.parts, new.parts, at_once=at_once)
        if self._weights is not None:
            self.algorithmic += self._algorithmic(old, new, after - before)

    def _algorithmic(self, old: KinematicState, new: KinematicState, more: Floats) -> float:
        """Return the energy dissipated by the integrator in a step; `more`: increase of the force.

        The balance ``M a_m + C v_f + K u_f + sum_b K_b p_f = f_f`` holds between the step's ends,
        ``x_m = x_mean + (1/2 - m) dx`` and ``x_f = x_mean + (1/2 - f) dx`` with
        ``x_mean = (x_0 + x_1) / 2``, ``dx = x_1 - x_0``, and with Newmark's rule
        ``du = dt v_mean + dt^2 (b - g/2) da`` and ``dv = dt (a_mean + (g - 1/2) da)``. Multiplied
        by ``du``, with ``du . M a_mean`` written as the change of the kinetic energy
        ``dv . M v_mean`` and a remainder, it reads::

            f_mean . du = d(kinetic) + d(strain) + damping + sum_b du . K_b p_mean + taken

            taken = (1/2 - f) du . (K du + C dv + sum_b K_b dp - df)
                  + (1 - m - g) du . M da  +  dt (b - g/2) dv . M da

        For ``m = f = 0`` this is the balance of Newmark's method (T. J. R. Hughes 2000, chapter
        9; S. Krenk, Comput. Methods Appl. Mech. Eng. 195, 2006), in which balance at both ends
        turns the first bracket into ``-du . M da``. It vanishes for ``b = 1/4, g = 1/2``.
        """
        system, weights = self.stepper.system, self._weights
        assert weights is not None
        moved, early = new.u - old.u, 0.5 - weights.force
        unbalanced = -more
        if isinstance(self.stepper, StaticStepper):
            unbalanced += system.stiffness_times(moved)
        else:
            faster = new.v - old.v if system.damped else None
            unbalanced += system.products(None, faster, moved)
        if self._memory:
            unbalanced += self._memory.force(new.parts - old.parts)
        taken = early * float(unbalanced @ moved)
        if isinstance(self.stepper, StaticStepper):
            return taken
        inertia = system.mass_times(new.a - old.a)
        taken += (1.0 - weights.mass - weights.gamma) * float(inertia @ moved)
        late = self.stepper.step * (weights.beta - 0.5 * weights.gamma)
        return taken + late * float(inertia @ (new.v - old.v))

    @property
    def residual(self) -> float:
        """Return the residual of the balance, relative to the total absolute work."""
        spent = (self.kinetic, self.strain, self.stored, self.damping, self.relaxation)
        missing = abs(self.work - sum(spent) - self.algorithmic)
        return missing / self.total_absolute_work if self.total_absolute_work else missing
