"""A slow insertion with the tissue's inertia, stepped in time.

The tip sticks to the entry point until its force is that of cutting; then it cuts at every step
and every shaft point slips forward. What the march finds without inertia, this must approach as
the speed goes to zero.
"""

import dataclasses
from collections.abc import Iterator

import numpy as np

from needlefem.arrays import Floats, Vector
from needlefem.dynamics import ImplicitStepper, Motion, TissueSystem
from needlefem.errors import SimulationError
from needlefem.fem.interpolation import Weights
from needlefem.fem.responses import SharedResponses
from needlefem.needle.contact import Contact
from needlefem.needle.functionals import Trial
from needlefem.needle.instrument import Instrument

TOLERANCE = 1e-11
"""Distance of the tip from where the needle is at which a step is solved, m."""
MOST_ITERATIONS = 40


@dataclasses.dataclass(frozen=True, eq=False)
class DynamicState:
    """Tip and tissue at one time: time (s), depth (m), material point at the tip, tip's force."""

    time: float
    depth: float
    tip: Vector
    tip_force: float


class DynamicInsertion:
    """A needle pushed in at constant speed into a tissue with inertia.

    Parameters
    ----------
    instrument : Instrument
    dynamics : ImplicitStepper
        Of the tissue, by Newmark's method: contact forces are those at the step's end.
    speed : float, m/s
    """

    def __init__(self, instrument: Instrument, dynamics: ImplicitStepper, speed: float) -> None:
        if not isinstance(dynamics.system, TissueSystem):
            raise TypeError("a needle needs a tissue")
        self.model = dynamics.system.model
        self.instrument, self.dynamics, self.speed = instrument, dynamics, speed
        self._responses = SharedResponses(self.model, dynamics.factor)
        self.contact = Contact(self._responses, instrument.axis.frame)
        self.motion: Motion = dynamics.at_rest()
        self._last = instrument.axis.entry  # end of the newest whole piece
        self._tip = instrument.axis.entry
        self._cutting = False

    def iterate(self, max_depth: float) -> Iterator[DynamicState]:
        """Yield the state after every time step until a depth is reached."""
        count = int(np.ceil(max_depth / (self.speed * self.dynamics.step) - 1e-9))
        for number in range(1, count + 1):
            time = number * self.dynamics.step
            depth = self.speed * time
            free = self.dynamics.free_motion(self.motion)
            self._set_background(free)
            trial, forces = self._step(depth)
            self._finish(free, trial, forces)
            yield DynamicState(time, depth, self._tip, float(forces[0]))

    def _set_background(self, free: Floats) -> None:
        model = self.model
        field = np.zeros(model.ndofs)
        field[model.free_dofs] = free
        self.contact.background = model.nodal(field)
        self.contact.balance()

    def _step(self, depth: float) -> tuple[Trial, Floats]:
        """Return functionals and forces of the step's end."""
        if not self._cutting:
            weights = self.instrument.tip(self._tip)
            trial = self.contact.try_functionals(weights)
            wanted = np.zeros(self.contact.dim)
            wanted[0] = depth
            rhs = wanted - trial.displacement
            forces: Floats = np.linalg.solve(trial.compliance, rhs).astype(float)
            if forces[0] < self.instrument.cutting_force_at(weights):
                return trial, forces
            self._cutting = True
            self.contact.adopt(trial, 0, 0.0, np.zeros(self.contact.dim - 1), 0.0)
        return self._cut(depth)

    def _cut(self, depth: float) -> tuple[Trial, Floats]:
        """Find the material point that is at the tip when it cuts at this depth."""
        axis = self.instrument.axis
        tip = self._tip + 0.5 * self.speed * self.dynamics.step * axis.direction
        jacobian = np.eye(len(tip))
        trial, forces, residual = self._try(tip, depth)
        for _ in range(MOST_ITERATIONS):
            if np.max(np.abs(residual)) <= TOLERANCE:
                break
            change = -np.linalg.solve(jacobian, residual)
            ahead, more = float(axis.along(tip) - axis.along(self._tip)), axis.direction @ change
            if ahead + more <= 0.0:  # the tip can't go back: go half way towards where it was
                change *= -0.5 * ahead / more
            trial, forces, reached = self._try(tip + change, depth)
            error = reached - residual - jacobian @ change
            jacobian = jacobian + np.outer(error, change) / (change @ change)
            tip, residual = tip + change, reached
        else:
            raise SimulationError(f"no tip position found at depth {depth:.4g} m")
        self._tip = tip
        return trial, forces

    def _try(self, tip: Vector, depth: float) -> tuple[Trial, Floats, Floats]:
        """Return the trial, its forces, and where the tip is off the needle's (world frame)."""
        axis, dim = self.instrument.axis, self.contact.dim
        weights: Weights = self.instrument.tip_and_piece(tip, self._last)
        trial = self.contact.try_functionals(weights)
        length = float(np.linalg.norm(tip - self._last))
        forces = np.zeros(2 * dim)
        forces[0] = self.instrument.cutting_force_at(weights)
        forces[dim] = self.instrument.friction_at(weights) * length
        stiffness = self.instrument.lateral_stiffness * length
        loose = trial.displacement + trial.compliance @ forces
        gap = axis.offset(0.5 * (tip + self._last)) + loose[dim + 1 :]
        hold = np.eye(dim - 1) + stiffness * trial.compliance[dim + 1 :, dim + 1 :]
        forces[dim + 1 :] = -stiffness * np.linalg.solve(hold, gap)
        moved = (trial.displacement + trial.compliance @ forces)[:dim]
        return trial, forces, tip + moved @ axis.frame - axis.tip(depth)

    def _finish(self, free: Floats, trial: Trial, forces: Floats) -> None:
        """Move the tissue under all contact forces; keep the piece once it is long enough."""
        model, frame = self.model, self.instrument.axis.frame
        lateral = self.contact.lateral_forces(trial, forces)
        load = np.zeros(model.ndofs)
        on_path = np.column_stack([self.contact.axial, lateral]) @ frame
        for piece, force in zip(self.contact.pieces, on_path, strict=True):
            load[model.node_dofs[piece.nodes]] += piece.weights[:, None] * force
        dofs = model.node_dofs[trial.weights.nodes]
        for row, force in zip(trial.weights.rows, forces.reshape(-1, len(frame)), strict=True):
            load[dofs] += row[:, None] * (force @ frame)
        moved = free + self.dynamics.factor.solve(load[model.free_dofs])
        self.motion = self.dynamics.advance(self.motion, moved)
        length = float(np.linalg.norm(self._tip - self._last))
        if self._cutting and length >= (1.0 - 1e-9) * self.instrument.spacing:
            axis = self.instrument.axis
            offset = axis.offset(0.5 * (self._tip + self._last))
            compliance = 1.0 / (self.instrument.lateral_stiffness * length)
            self.contact.adopt(trial, 1, float(forces[len(frame)]), offset, compliance)
            self._last = self._tip
