"""Needle and tissue at one moment."""

import dataclasses
from collections.abc import Sequence
from enum import StrEnum

import numpy as np

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem.contact.functionals import ContactSegment


class TipPhase(StrEnum):
    """What the tip does."""

    LOADING = "pressing"
    CUTTING = "cutting"
    RUPTURE = "jumping"
    RETRACTED = "withdrawn"
    OUTSIDE = "out"


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class State:
    """Needle and tissue in equilibrium at one depth (or, while `jumping`, inside a snap).

    Pieces are those of the path that the needle lies in, from the entry on.

    Parameters
    ----------
    depth : float, m
        Travel of the tip from the undeformed skin, s.
    tip : array, shape (dim,), m
        Material point at the tip.
    tip_force : float, N (N/m in 2D)
        Axial force of the tip on the tissue, R.
    cutting_force : float, N (N/m in 2D)
        What the tip would cut at there.
    tip_lateral : array, shape (dim - 1,), N (N/m in 2D)
        Lateral force of the tip, which only a tip that holds its point has.
    tip_nodes, tip_weights : arrays, shape (k,)
        The kernel's mean displacement is ``tip_weights @ u[tip_nodes]``.
    friction_force : array, shape (npieces,), N (N/m in 2D)
        Friction force of the shaft on every piece of the path.
    lateral_force : array, shape (npieces, dim - 1), N (N/m in 2D)
        Lateral force of the shaft on every piece.
    segment_displacement : array, shape (npieces, dim), m
        Mean displacement of the pieces, in the needle's frame.
    jumping : bool
        The tip is running ahead at fixed depth: this state can't be held.
    time : float, s
        From the first touch on.
    inserted_length : float, m
        Length of the cut path that the needle lies in.
    partial_segment : ContactSegment, optional
        The piece that the tip is in, which the needle fills in part: the last of the pieces.
    slipping : array, shape (npieces,)
        1: the needle slips forward in the piece, -1: backward, 0: they stick.
    tip_phase : TipPhase
        What the tip does: it presses on the crack front, cuts, or is drawn back on its path.
    tip_displacement : float, m
        Axial mean displacement over the tip's kernel.
    seeds : array, shape (nseeds, dim), m
        Where everything released so far is in the world.
    """

    depth: float
    tip: Vector
    tip_force: float
    cutting_force: float
    tip_lateral: Floats
    tip_nodes: Ints
    tip_weights: Floats
    friction_force: Floats
    lateral_force: Floats
    segment_displacement: Floats
    jumping: bool = False
    time: float = 0.0
    inserted_length: float = 0.0
    partial_segment: ContactSegment | None = None
    slipping: Ints | None = None
    tip_phase: TipPhase = TipPhase.CUTTING
    tip_displacement: float = 0.0
    seeds: Points = dataclasses.field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def full_segments(self) -> int:
        """Number of pieces that the needle fills."""
        return len(self.friction_force) - (self.partial_segment is not None)

    def filled(self, pieces: Sequence[ContactSegment]) -> tuple[ContactSegment, ...]:
        """Return the pieces that the needle lies in, of those of the whole path."""
        whole = tuple(pieces[: self.full_segments])
        return whole if self.partial_segment is None else (*whole, self.partial_segment)

    @property
    def force(self) -> float:
        """Axial force on the needle, N (N/m in 2D)."""
        return self.tip_force + float(np.sum(self.friction_force))
