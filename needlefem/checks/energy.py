"""Energy of time integration."""

import numpy as np

from needlefem.dynamics import KinematicState, Newmark, TissueSystem, kinetic_energy
from needlefem.fem.tissue_model import TissueModel


def energy_drift(model: TissueModel, step: float, count: int, lumping: str | None = None) -> float:
    """Return the largest relative change of energy over `count` free steps of `step` s.

    Average acceleration without damping, from a smooth displacement at rest; the energy is
    looked at a hundred times.
    """
    system = TissueSystem(model, lumping=lumping)
    dynamics = Newmark().stepper(system, step)

    def energy_of(motion: KinematicState) -> float:
        return kinetic_energy(system, motion.v) + system.strain_energy(motion.u)

    shape = np.sin(np.pi * (model.nodes - model.nodes.min(axis=0)) / np.ptp(model.nodes, axis=0))
    field = np.zeros(model.ndofs)
    field[model.node_dofs] = np.prod(shape, axis=1)[:, None] * np.arange(1, model.dim + 1)
    start = field[model.free_dofs]
    motion = dynamics.start(start, np.zeros_like(start))
    energy, drift = energy_of(motion), 0.0
    for number in range(1, count + 1):
        motion = dynamics.advance(motion, dynamics.free_motion(motion))
        if number % max(1, count // 100) == 0:
            drift = max(drift, abs(energy_of(motion) / energy - 1.0))
    return drift
