"""Needle and tissue at one moment."""

import dataclasses
from collections.abc import Sequence
from enum import StrEnum

import numpy as np

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem.contact.functionals import Piece


class Way(StrEnum):
    """What the tip does."""

    PRESSING = "pressing"
    CUTTING = "cutting"
    JUMPING = "jumping"
    WITHDRAWN = "withdrawn"
    OUT = "out"


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
    axial : array, shape (npieces,), N (N/m in 2D)
        Friction force of the shaft on every piece of the path.
    lateral : array, shape (npieces, dim - 1), N (N/m in 2D)
        Lateral force of the shaft on every piece.
    moved : array, shape (npieces, dim), m
        Mean displacement of the pieces, in the needle's frame.
    jumping : bool
        The tip is running ahead at fixed depth: this state can't be held.
    time : float, s
        From the first touch on.
    covered : float, m
        Length of the cut path that the needle lies in.
    end : Piece, optional
        The piece that the tip is in, which the needle fills in part: the last of the pieces.
    slipping : array, shape (npieces,)
        1: the needle slips forward in the piece, -1: backward, 0: they stick.
    way : Way
        What the tip does: it presses on the crack front, cuts, or is drawn back on its path.
    tip_moved : float, m
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
    axial: Floats
    lateral: Floats
    moved: Floats
    jumping: bool = False
    time: float = 0.0
    covered: float = 0.0
    end: Piece | None = None
    slipping: Ints | None = None
    way: Way = Way.CUTTING
    tip_moved: float = 0.0
    seeds: Points = dataclasses.field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def whole(self) -> int:
        """Number of pieces that the needle fills."""
        return len(self.axial) - (self.end is not None)

    def filled(self, pieces: Sequence[Piece]) -> tuple[Piece, ...]:
        """Return the pieces that the needle lies in, of those of the whole path."""
        whole = tuple(pieces[: self.whole])
        return whole if self.end is None else (*whole, self.end)

    @property
    def force(self) -> float:
        """Axial force on the needle, N (N/m in 2D)."""
        return self.tip_force + float(np.sum(self.axial))
