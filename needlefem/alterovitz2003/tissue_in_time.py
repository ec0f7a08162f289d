"""Tissue stepped by Newmark's method with lumped mass, whose nodes may be moved."""

import numpy as np

from needlefem._arrays import Floats
from needlefem.alterovitz2003.movable_mesh import MovableMesh
from needlefem.alterovitz2003.operator_update import Corrected, Equations, LowRank, Refactored
from needlefem.dynamics import Damping, KinematicState, Newmark, TissueSystem
from needlefem.fem.compliance import CachedCompliance
from needlefem.fem.tissue_model import TissueModel


class TissueInTime:
    """What all insertions in one tissue share.

    Parameters
    ----------
    model : TissueModel
        Of P1 triangles.
    integrator : Newmark
    step : float, s
    damping : Damping
    refactor : bool
        Factorise anew whenever another node is at the tip, instead of correcting one factor.

    Attributes
    ----------
    elastic, inertia : float
        The step's operator is ``elastic K + inertia M``.
    """

    def __init__(
        self, model: TissueModel, integrator: Newmark, step: float, damping: Damping, *,
        refactor: bool = False,
    ) -> None:  # fmt: skip
        self.model, self.mesh, self.equations = model, MovableMesh(model), Equations(model)
        self.system = TissueSystem(model, damping, lumping="row-sum")
        self.stepper = integrator.stepper(self.system, step)
        beta, gamma = integrator.beta, integrator.gamma
        mass, drag = 1.0 / (beta * step**2), gamma / (beta * step)
        self.elastic = 1.0 + drag * damping.stiffness_time
        self.inertia = mass + drag * damping.mass_rate
        self.damping = damping
        predicted = np.array([1.0, step, step**2 * (0.5 - beta)])
        rates = drag * predicted - np.array([0.0, 1.0, step * (1.0 - gamma)])
        # what M and K are multiplied with on the right-hand side, of (u, v, a)
        self._known = np.array(
            [mass * predicted + damping.mass_rate * rates, damping.stiffness_time * rates]
        )
        self._mass: Floats = self.system.mass.diagonal()
        self._stiffness = model.free_block(model.stiffness.matrix.tocsr())
        self._refactor = refactor
        self._responses = CachedCompliance(model, self.stepper.factor)

    def corrected(self) -> Corrected:
        """Return the step's operator, ready to be corrected."""
        if self._refactor:
            matrix = self.elastic * self._stiffness
            return Refactored(self.model, matrix + self.inertia * self.system.mass)
        return LowRank(self.model, self.stepper.factor, self._responses)

    def known(self, motion: KinematicState) -> Floats:
        """Return what M and K are multiplied with in a step's right-hand side, shape (2, n)."""
        found: Floats = self._known @ np.array([motion.u, motion.v, motion.a])
        return found

    def rhs(self, known: Floats) -> Floats:
        """Return the right-hand side with all nodes at home, shape (n,)."""
        found: Floats = self._mass * known[0] + self._stiffness @ known[1]
        return found
