"""Energy of a motion and where it goes, every term from its own definition."""

import dataclasses

from needlefem.arrays import Floats
from needlefem.dynamics.memory import Memory
from needlefem.dynamics.steppers import Motion, StaticStepper, Stepper
from needlefem.dynamics.systems import System


def kinetic_energy(system: System, v: Floats) -> float:
    """Return the kinetic energy of a velocity, J."""
    return 0.5 * float(v @ system.mass_times(v))


@dataclasses.dataclass
class EnergyLedger:
    """Work of the forces, and what became of it, J (J/m in 2D).

    Over a step forces are taken as the mean of those at its ends. `kinetic`, `strain` and
    `stored` (in the springs of viscoelastic branches) are what was gained since the start;
    `damping` and `relaxation` what viscosity took; `algorithmic` what the integrator took
    because forces balance within its steps, not at their ends, and because its kinetic energy is
    not the work of inertia. Average acceleration has none of the last. `turnover` is the work of
    all steps, whatever its sign.
    """

    stepper: Stepper
    work: float = 0.0
    turnover: float = 0.0
    kinetic: float = 0.0
    strain: float = 0.0
    stored: float = 0.0
    damping: float = 0.0
    relaxation: float = 0.0
    algorithmic: float = 0.0

    def __post_init__(self) -> None:
        self._memory = Memory(self.stepper.system.branches, self.stepper.step)

    def add(self, old: Motion, new: Motion, before: Floats, after: Floats) -> None:
        """Account for one step under forces at its start and end, shape (n,), N."""
        system, moved = self.stepper.system, new.u - old.u
        work = 0.5 * float((before + after) @ moved)
        elastic = float(system.stiffness_times(0.5 * (old.u + new.u)) @ moved)
        kinetic, inertia, drag = 0.0, 0.0, 0.0
        if not isinstance(self.stepper, StaticStepper):
            kinetic = kinetic_energy(system, new.v) - kinetic_energy(system, old.v)
            inertia = float(system.mass_times(0.5 * (old.a + new.a)) @ moved)
            drag = float(system.products(None, 0.5 * (old.v + new.v), None) @ moved)
        relaxing = 0.0
        if self._memory:
            parts = (old.parts, new.parts)
            self.stored += self._memory.energy(parts[1]) - self._memory.energy(parts[0])
            self.relaxation += self._memory.lost(*parts)
            relaxing = float(self._memory.force(0.5 * (parts[0] + parts[1])) @ moved)
        self.work += work
        self.turnover += abs(work)
        self.kinetic += kinetic
        self.strain += system.strain_energy(new.u) - system.strain_energy(old.u)
        self.damping += drag
        out_of_balance = work - inertia - drag - elastic - relaxing
        self.algorithmic += out_of_balance + (inertia - kinetic)

    @property
    def residual(self) -> float:
        """What is missing, relative to the turnover."""
        spent = (self.kinetic, self.strain, self.stored, self.damping, self.relaxation)
        missing = abs(self.work - sum(spent) - self.algorithmic)
        return missing / self.turnover if self.turnover else missing
