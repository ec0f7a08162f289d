"""The outcome of an insertion."""

import dataclasses
from enum import StrEnum
from functools import cached_property

import numpy as np

from needlefem.arrays import Floats, Ints, Points, Vector
from needlefem.fem.model import Model
from needlefem.needle.axis import Axis
from needlefem.needle.functionals import Piece
from needlefem.needle.instrument import Instrument
from needlefem.scene import Scene


class Status(StrEnum):
    """How an insertion ended."""

    COMPLETED = "completed"
    STOPPED = "stopped"
    NOT_PUNCTURED = "not_punctured"
    RESTICK = "restick"
    NOT_CONVERGED = "not_converged"
    LEFT_TISSUE = "left_tissue"


@dataclasses.dataclass(frozen=True)
class Outcome:
    """A status with a sentence."""

    status: Status
    sentence: str


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class State:
    """Needle and tissue in equilibrium at one depth (or, while `jumping`, inside a snap).

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

    @property
    def force(self) -> float:
        """Axial force on the needle, N (N/m in 2D)."""
        return self.tip_force + float(np.sum(self.axial))


@dataclasses.dataclass(frozen=True)
class Snap:
    """A stretch of material that the tip jumped over at one depth.

    `first` and `last` number the states before and after the jump.
    """

    depth: float
    first: int
    last: int


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Insertion:
    """What happened while the needle was pushed in.

    Parameters
    ----------
    scene : Scene
        Resolved.
    model : Model
        The tissue.
    instrument : Instrument
        The needle on its line.
    outcome : Outcome
        How it ended; the path so far is there whatever the status.
    states : tuple of State
        From the first touch on.
    pieces : tuple of Piece
        Of the cut path, in the order of their numbers in the states. The first is the held entry
        point.
    snaps : tuple of Snap
    evaluations : int
        Contact evaluations spent.
    """

    scene: Scene
    model: Model
    instrument: Instrument
    outcome: Outcome
    states: tuple[State, ...]
    pieces: tuple[Piece, ...]
    snaps: tuple[Snap, ...]
    evaluations: int

    @property
    def axis(self) -> Axis:
        """The needle's line."""
        return self.instrument.axis

    @cached_property
    def depths(self) -> Floats:
        """Depth of every state, shape (nstates,), m."""
        return np.array([state.depth for state in self.states])

    @cached_property
    def tips(self) -> Points:
        """Material point at the tip in every state, shape (nstates, dim), m."""
        return np.array([state.tip for state in self.states])

    @property
    def puncture_depth(self) -> float | None:
        """Depth at which the skin was cut, m, or None."""
        pressed = self.states[1]
        return pressed.depth if pressed.tip_force >= pressed.cutting_force else None
