"""A shaft that is embedded in a tissue over its full length: friction without a tip."""

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.contact import CondensedContact, FrictionStep, SlipWeakeningFriction
from needlefem.fem import CachedCompliance, TissueModel
from needlefem.insertion import straight_contact
from needlefem.needle import InsertionAxis, NeedleInterface, PointKernel, cross_section

LATERAL_STIFFNESS = 1e9
"""Lateral penalty, N/m^3; without effect where the tissue moves along the axis only."""


class EmbeddedShaft:
    """A shaft in an unloaded tissue that is moved along its axis by prescribed distances.

    Parameters
    ----------
    model : TissueModel
    ends : two arrays, shape (dim,), m
        Ends of the shaft.
    pieces : int
        Number of segments of equal length.
    limit : float, N/m (Pa in 2D)
        Kinetic friction per length.
    friction : SlipWeakeningFriction, optional
        Slip weakening and compliance of sticking.
    thickness : float, m
        Radius over which the forces are distributed across the axis.

    Attributes
    ----------
    travel : float, m
    pull : array, shape (pieces,), N (N/m in 2D)
        Friction forces on the segments.
    moved : array, shape (pieces,), m
        Axial displacement of the tissue at the segments.
    slipping : array, shape (pieces,)
        1, -1: direction of slip in the last step; 0: the segment stuck.
    dissipated : float, J (J/m in 2D)
        Friction work with the mean forces of the steps.
    """

    def __init__(
        self,
        model: TissueModel,
        ends: tuple[Vector, Vector],
        pieces: int,
        limit: float,
        *,
        friction: SlipWeakeningFriction | None = None,
        thickness: float = 0.0,
    ) -> None:
        length = float(np.linalg.norm(ends[1] - ends[0]))
        self._contact = _path(model, ends, pieces, thickness)
        self.friction = friction or SlipWeakeningFriction()
        self.lengths: Floats = np.full(pieces, length / pieces)
        self.kinetic: Floats = limit * self.lengths
        self.pull: Floats = np.zeros(pieces)
        self.moved: Floats = np.zeros(pieces)
        self.travel = self.dissipated = 0.0
        self.slipping: Floats = np.zeros(pieces)
        self._slipped: Floats = np.zeros(pieces)

    def move(self, travel: float) -> float:
        """Move the needle to a position (m, from its first one); return its force, N (N/m)."""
        rub = FrictionStep(
            friction=self.friction,
            kinetic=self.kinetic,
            slipped=self._slipped,
            travel=self.moved + (travel - self.travel),
            old=self.pull,
            lengths=self.lengths,
        )
        sliding = self._contact.sliding()
        forces, slip, _ = rub.solve(sliding.compliance, sliding.displacement, self.pull)
        self.dissipated += 0.5 * float((self.pull + forces) @ slip)
        self._slipped = rub.after(slip)
        self.moved = sliding.displacement + sliding.compliance @ forces
        self.pull, self.slipping, self.travel = forces, np.sign(slip), travel
        return float(forces.sum())

    @property
    def strain_energy(self) -> float:
        """Strain energy of the tissue, J (J/m in 2D)."""
        return 0.5 * float(self.pull @ self.moved)


def _path(
    model: TissueModel, ends: tuple[Vector, Vector], pieces: int, thickness: float
) -> CondensedContact:
    """Return a contact with a path of equal segments and a lateral penalty."""
    start, end = ends
    direction = (end - start) / np.linalg.norm(end - start)
    instrument = NeedleInterface(
        axis=InsertionAxis(start, direction),
        kernel=PointKernel(model.dim),
        interpolation=model.interpolation,
        cutting_force=np.zeros(model.nnodes),
        shaft_friction=np.zeros(model.nnodes),
        section=cross_section(thickness, 24 if thickness else 1, model.dim),
        lateral_penalty=LATERAL_STIFFNESS,
        spacing=float(np.linalg.norm(end - start)) / pieces,
        inward=direction,
    )
    return straight_contact(instrument, CachedCompliance(model), pieces)
