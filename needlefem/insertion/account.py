"""The energy ledger of any motion, step by step and in constant memory.

As `insertion/ledger.py`, of which it keeps the terms: forces are taken as their means over a
step, every functional of the displacement that carries a force at either end as itself. What
the needle fills in part is a different functional at both ends; its friction is that of both
slips, and its lateral hold gives or takes ``force x gap / 2`` of what it catches or lets go.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from needlefem.arrays import Floats
from needlefem.fem.interpolation import Weights
from needlefem.insertion.equations import Field
from needlefem.insertion.result import Ledger
from needlefem.insertion.state import State, Way
from needlefem.needle.functionals import Piece


@dataclasses.dataclass(frozen=True)
class Spent:
    """What the needle's work went into in one step, J (J/m in 2D); terms as in `Ledger`.

    Parameters
    ----------
    caught : float
        Of the capture, what catching by velocity took; the rest is the lateral hold's.
    mismatch : float
        Work that is in none of them, in elastic tissue.
    """

    work: float
    strain: float
    hold: float
    friction: float
    cutting: float
    snap: float
    contact: float
    capture: float
    caught: float
    mismatch: float

    @property
    def tip(self) -> float:
        """What the tip took."""
        return self.cutting + self.snap + self.contact

    @property
    def least(self) -> float:
        """The least that friction, cutting, a snap or all together took: none may give.

        Not counted is the lateral hold, which is elastic: it gives back what it stored.
        """
        return min(self.friction, self.cutting, self.snap, self.friction + self.tip + self.caught)


@dataclasses.dataclass
class Account:
    """Energies since the first state, J (J/m in 2D).

    Parameters
    ----------
    pieces : sequence of Piece
        Of the whole path; may grow.
    give : float
        Compliance of sticking over that of the lateral hold.
    inertial : bool
        Whether what sticks may have had another velocity than the needle: what friction takes
        of it in that step is capture (where sticking is rigid).

    Attributes
    ----------
    least : float
        The least of `Spent.least`.
    mismatch : float
        Largest difference of a step's work from all that it was spent on (elastic tissue).
    turnover : float
        Work of all steps, whatever its sign.
    """

    pieces: Sequence[Piece]
    give: float = 0.0
    inertial: bool = False
    work: float = 0.0
    strain: float = 0.0
    hold: float = 0.0
    friction: float = 0.0
    cutting: float = 0.0
    snap: float = 0.0
    capture: float = 0.0
    contact: float = 0.0
    relaxation: float = 0.0
    kinetic: float = 0.0
    damping: float = 0.0
    algorithmic: float = 0.0
    least: float = 0.0
    mismatch: float = 0.0
    turnover: float = 0.0

    def weigh(self, old: State, new: State, fields: tuple[Field, Field]) -> Spent:
        """Return what a step between two states, with their fields, spends."""
        travel = new.depth - old.depth
        sides = (
            _Side(old, fields[1], self.pieces, new),
            _Side(new, fields[0], self.pieces, old),
        )
        work = 0.5 * (old.force + new.force) * travel
        signed = list(zip(sides, (1, -1), strict=True))
        friction = 0.5 * sum(float(np.sum(side.friction(travel, sign))) for side, sign in signed)
        tip = [0.5 * side.tip(travel, sign) for side, sign in signed]
        cutting, snap, contact = _tip_parts(old, new, tip)
        hold = _hold(new, self.pieces) - _hold(old, self.pieces)
        stick = self.give * (_stick(new, self.pieces) - _stick(old, self.pieces))
        hold, friction = hold + stick, friction - stick
        capture = 0.5 * (sides[1].caught(self.pieces) - sides[0].caught(self.pieces))
        capture += 0.5 * (sides[1].let_go() - sides[0].let_go())
        strain = _strain(new) - _strain(old)
        mismatch = work - strain - friction - cutting - snap - contact - hold - capture
        caught = 0.0
        if self.inertial and new.way is Way.OUT:  # the needle lets go of its last piece
            contact, friction = contact + friction, 0.0
        elif self.inertial:
            grown = _regrown(old, new, sides, travel)
            if not self.give:
                caught = 0.5 * sum(side.stuck(travel, sign, new) for side, sign in signed)
            friction, capture = friction - caught - grown, capture + grown
        return Spent(
            work=work, strain=strain, hold=hold, friction=friction, cutting=cutting, snap=snap,
            contact=contact, capture=capture + caught, caught=caught, mismatch=mismatch,
        )  # fmt: skip

    def add(self, spent: Spent) -> None:
        """Account for a step."""
        for name in ("work", "strain", "hold", "friction", "cutting", "snap", "contact", "capture"):
            setattr(self, name, getattr(self, name) + getattr(spent, name))
        self.turnover += abs(spent.work)
        self.mismatch = max(self.mismatch, abs(spent.mismatch))
        self.least = min(self.least, spent.least)

    def begin(self, found: Ledger) -> None:
        """Go on from the ledger of a march."""
        for name in ("work", "strain", "hold", "friction", "cutting", "snap", "capture"):
            setattr(self, name, getattr(found, name))
        self.turnover, self.mismatch = abs(found.work), found.identity * abs(found.work)

    def set_tissue(self, energies: Mapping[str, float]) -> None:
        """Take the tissue's energies, stored and lost, from a medium that knows them."""
        if not energies:
            return
        self.strain, self.mismatch = energies["strain"] + energies["stored"], 0.0
        for name in ("relaxation", "kinetic", "damping", "algorithmic"):
            setattr(self, name, energies.get(name, 0.0))

    def ledger(self) -> Ledger:
        """Return the energies."""
        return Ledger(
            work=self.work,
            strain=self.strain,
            hold=self.hold,
            friction=self.friction,
            cutting=self.cutting,
            snap=self.snap,
            capture=self.capture,
            contact=self.contact,
            relaxation=self.relaxation,
            kinetic=self.kinetic,
            damping=self.damping,
            algorithmic=self.algorithmic,
            turnover=self.turnover,
            least=self.least,
            identity=self.mismatch / self.turnover if self.turnover else 0.0,
        )


class _Side:
    """The functionals with a force at one end of a step, in the fields of both ends."""

    def __init__(self, own: State, other: Field, pieces: Sequence[Piece], at_other: State) -> None:
        self.own = own
        self.common = min(own.whole, at_other.whole)
        elsewhere = [at_other.moved[: self.common]]
        for number in range(self.common, len(own.axial)):
            piece = _piece(own, number, pieces)
            elsewhere.append(other.means(Weights(piece.nodes, piece.weights[None])))
        self.elsewhere: Floats = np.concatenate(elsewhere)
        """Displacement of the own pieces in the other field, shape (npieces, dim), m."""
        tip = Weights(own.tip_nodes, own.tip_weights[None])
        self.tip_elsewhere: Floats = other.means(tip)[0]

    def slip(self, travel: float, sign: int) -> Floats:
        """Return how far the needle slipped in every piece."""
        found: Floats = travel - sign * (self.elsewhere[:, 0] - self.own.moved[:, 0])
        return found

    def friction(self, travel: float, sign: int) -> Floats:
        """Return friction times slip, of every piece."""
        found: Floats = self.own.axial * self.slip(travel, sign)
        return found

    def stuck(self, travel: float, sign: int, new: State) -> float:
        """Return that of pieces that the needle fills at both ends and that stick in the end."""
        assert new.slipping is not None
        sticks = new.slipping[: self.common] == 0
        return float(np.sum(self.friction(travel, sign)[: self.common][sticks]))

    def tip(self, travel: float, sign: int) -> float:
        return travel - sign * (float(self.tip_elsewhere[0]) - self.own.tip_moved)

    def let_go(self) -> float:
        """Return lateral force times way of a tip that holds the skin at its own end only."""
        return float(self.own.tip_lateral @ self.tip_elsewhere[1:])

    def caught(self, pieces: Sequence[Piece]) -> float:
        """Lateral force times gap in the other field, of pieces that the other end lacks."""
        total = 0.0
        for number in range(self.common, len(self.own.axial)):
            gap = _piece(self.own, number, pieces).offset + self.elsewhere[number, 1:]
            total += float(self.own.lateral[number] @ gap)
        return total


def _piece(state: State, number: int, pieces: Sequence[Piece]) -> Piece:
    if state.end is not None and number == state.whole:
        return state.end
    return pieces[number]


def _regrown(old: State, new: State, sides: tuple["_Side", "_Side"], travel: float) -> float:
    """Return what friction gives or takes as the tip's piece becomes another functional.

    As it slips it is the piece of the step's end; what it was at the start was let go of.
    """
    number = old.whole
    if old.end is None or number >= len(new.axial):
        return 0.0
    was, became = sides[0].slip(travel, 1)[number], sides[1].slip(travel, -1)[number]
    return 0.5 * float(old.axial[number] * (was - became))


def _tip_parts(old: State, new: State, apart: list[float]) -> tuple[float, float, float]:
    """Return what cutting, snaps, and the front's opening or closing within the step took."""
    forces = (old.tip_force, new.tip_force)
    total = float(np.dot(forces, apart))
    if new.way not in (Way.CUTTING, Way.JUMPING):
        return 0.0, 0.0, total
    excess = [max(s.tip_force - s.cutting_force, 0.0) for s in (old, new)]
    snap = float(np.dot(excess, apart))
    cutting = float(np.dot(np.subtract(forces, excess), apart))
    return cutting, snap, 0.0


def _hold(state: State, pieces: Sequence[Piece]) -> float:
    compliances = [_piece(state, n, pieces).compliance for n in range(len(state.axial))]
    return 0.5 * float(np.array(compliances) @ np.sum(state.lateral**2, axis=1))


def _stick(state: State, pieces: Sequence[Piece]) -> float:
    """Return the energy of sticking as if it gave way like the lateral hold."""
    compliances = [_piece(state, n, pieces).compliance for n in range(len(state.axial))]
    return 0.5 * float(np.array(compliances) @ state.axial**2)


def _strain(state: State) -> float:
    forces = np.column_stack([state.axial, state.lateral])
    return 0.5 * float(np.sum(forces * state.moved)) + 0.5 * state.tip_force * state.tip_moved
