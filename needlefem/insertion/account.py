"""The energy balance of any motion, step by step and in constant memory.

The terms are those of `insertion/energy_balance.py`. Forces are taken as their means over a step,
every functional of the displacement that carries a force at either end as itself. What
the needle fills in part is a different functional at both ends; its friction is that of both
slips, and its lateral hold gives or takes ``force x gap / 2`` of what it catches or lets go.

The tip's force is unilateral: it is there only while the needle's tip touches the material at the
crack front, ``R >= 0, gap >= 0, R gap = 0``. Where the gap opens or closes within a step, the mean
of both ends' forces times the needle's travel would count work over the gap, which there is not;
it is left out of the needle's work (``apart``). What is left is the work on the tissue.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from needlefem._arrays import Floats
from needlefem.contact.functionals import ContactSegment
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.insertion.result import EnergyTerms
from needlefem.insertion.state import State, TipPhase
from needlefem.insertion.step_equations import Field


@dataclasses.dataclass(frozen=True)
class EnergyIncrement:
    """What the needle's work went into in one step, J (J/m in 2D); terms as in `EnergyTerms`.

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
    capture: float
    caught: float
    mismatch: float

    @property
    def tip(self) -> float:
        """What the tip took."""
        return self.cutting + self.snap

    @property
    def least(self) -> float:
        """The least that friction, cutting, a snap or all together took: none may give.

        Not counted is the lateral hold, which is elastic: it gives back what it stored.
        """
        return min(self.friction, self.cutting, self.snap, self.friction + self.tip + self.caught)


@dataclasses.dataclass
class EnergyBalance:
    """Energies since the first state, J (J/m in 2D).

    Parameters
    ----------
    pieces : sequence of ContactSegment
        Of the whole path; may grow.
    give : float
        Compliance of sticking over that of the lateral hold.
    inertial : bool
        Whether what sticks may have had another velocity than the needle: what friction takes
        of it in that step is capture (where sticking is rigid).

    Attributes
    ----------
    least : float
        The least of `EnergyIncrement.least`.
    mismatch : float
        Largest difference of a step's work from all that it was spent on (elastic tissue).
    turnover : float
        Work of all steps, whatever its sign.
    """

    pieces: Sequence[ContactSegment]
    give: float = 0.0
    inertial: bool = False
    work: float = 0.0
    strain: float = 0.0
    hold: float = 0.0
    friction: float = 0.0
    cutting: float = 0.0
    snap: float = 0.0
    capture: float = 0.0
    relaxation: float = 0.0
    kinetic: float = 0.0
    damping: float = 0.0
    algorithmic: float = 0.0
    least: float = 0.0
    mismatch: float = 0.0
    turnover: float = 0.0

    def weigh(
        self, old: State, new: State, fields: tuple[Field, Field], front: float
    ) -> EnergyIncrement:
        """Return what a step between two states spends.

        Parameters
        ----------
        old, new : State
        fields : (Field, Field)
            Theirs.
        front : float, m
            Length of the cut path at the step's start.
        """
        travel = new.depth - old.depth
        sides = (
            _Side(old, fields[1], self.pieces, new),
            _Side(new, fields[0], self.pieces, old),
        )
        signed = list(zip(sides, (1, -1), strict=True))
        tip = [0.5 * side.tip(travel, sign) for side, sign in signed]
        cutting, snap, apart = _tip_parts(old, new, tip, front)
        work = 0.5 * (old.force + new.force) * travel - apart
        friction = 0.5 * sum(float(np.sum(side.friction(travel, sign))) for side, sign in signed)
        hold = _penalty_energy(new, self.pieces) - _penalty_energy(old, self.pieces)
        stick = self.give * (_stick(new, self.pieces) - _stick(old, self.pieces))
        hold, friction = hold + stick, friction - stick
        capture = 0.5 * (sides[1].caught(self.pieces) - sides[0].caught(self.pieces))
        capture += 0.5 * (sides[1].let_go() - sides[0].let_go())
        strain = _strain(new) - _strain(old)
        mismatch = work - strain - friction - cutting - snap - hold - capture
        caught = 0.0
        if self.inertial and new.tip_phase is not TipPhase.OUTSIDE and not self.give:
            caught = 0.5 * sum(side.stuck(travel, sign, new) for side, sign in signed)
        let_go = self._let_go(old, new, sides, travel)
        friction, capture = friction - caught - let_go, capture + let_go
        return EnergyIncrement(
            work=work, strain=strain, hold=hold, friction=friction, cutting=cutting, snap=snap,
            capture=capture + caught, caught=caught, mismatch=mismatch,
        )  # fmt: skip

    def _let_go(
        self, old: State, new: State, sides: tuple["_Side", "_Side"], travel: float
    ) -> float:
        """Return what friction forces of the step's start give or take that do not slip on.

        The piece that the tip is in is another functional at the step's end: it slips as that. Of
        its force at the start, ``f`` on the length ``l``, as much as is on what the needle still
        lies in goes on with it, and the rest was let go of. That of pieces that stuck and that the
        needle has left was let go of too. Where pieces slip on as they did, all of it is friction.
        """
        first = min(old.full_segments, new.full_segments)
        if old.slipping is None or new.slipping is None or first >= len(old.friction_force):
            return 0.0
        was, total = sides[0].slip(travel, 1), 0.0
        if first < len(new.friction_force):
            became = sides[1].slip(travel, -1)[first]
            slips_on = old.friction_force[first] * new.slipping[first] > 0.0
            if not slips_on or (self.inertial and first == old.full_segments):
                lengths = [1.0 / _piece(s, first, self.pieces).compliance for s in (new, old)]
                share = 1.0 if slips_on else min(lengths[0] / lengths[1], 1.0)
                total += old.friction_force[first] * (was[first] - share * became)
                total += (1.0 - share) * self._stretched(old, first)
        for number in range(len(new.friction_force), len(old.friction_force)):
            if old.slipping[number] == 0:
                total += old.friction_force[number] * was[number] + self._stretched(old, number)
        return 0.5 * float(total)

    def _stretched(self, state: State, number: int) -> float:
        """Return twice the energy of sticking, where it gives way, of a piece."""
        piece = _piece(state, number, self.pieces)
        return self.give * piece.compliance * float(state.friction_force[number]) ** 2

    def add(self, spent: EnergyIncrement) -> None:
        """Account for a step."""
        for name in ("work", "strain", "hold", "friction", "cutting", "snap", "capture"):
            setattr(self, name, getattr(self, name) + getattr(spent, name))
        self.turnover += abs(spent.work)
        self.mismatch = max(self.mismatch, abs(spent.mismatch))
        self.least = min(self.least, spent.least)

    def begin(self, found: EnergyTerms) -> None:
        """Go on from the ledger of a march."""
        for name in ("work", "strain", "hold", "friction", "cutting", "snap", "capture"):
            setattr(self, name, getattr(found, name))
        self.turnover, self.mismatch = found.turnover, found.identity * abs(found.work)
        self.least = min(found.least, 0.0)

    def set_tissue(self, energies: Mapping[str, float]) -> None:
        """Take the tissue's energies, stored and lost, from a medium that knows them."""
        if not energies:
            return
        self.strain, self.mismatch = energies["strain"] + energies["stored"], 0.0
        for name in ("relaxation", "kinetic", "damping", "algorithmic"):
            setattr(self, name, energies.get(name, 0.0))

    def energy_terms(self) -> EnergyTerms:
        """Return the energies."""
        return EnergyTerms(
            work=self.work,
            strain=self.strain,
            hold=self.hold,
            friction=self.friction,
            cutting=self.cutting,
            snap=self.snap,
            capture=self.capture,
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

    def __init__(
        self, own: State, other: Field, pieces: Sequence[ContactSegment], at_other: State
    ) -> None:
        self.own = own
        self.common = min(own.full_segments, at_other.full_segments)
        elsewhere = [at_other.segment_displacement[: self.common]]
        for number in range(self.common, len(own.friction_force)):
            piece = _piece(own, number, pieces)
            elsewhere.append(other.means(LinearFunctionals(piece.nodes, piece.weights[None])))
        self.elsewhere: Floats = np.concatenate(elsewhere)
        """Displacement of the own pieces in the other field, shape (npieces, dim), m."""
        tip = LinearFunctionals(own.tip_nodes, own.tip_weights[None])
        self.tip_elsewhere: Floats = other.means(tip)[0]

    def slip(self, travel: float, sign: int) -> Floats:
        """Return how far the needle slipped in every piece."""
        found: Floats = travel - sign * (self.elsewhere[:, 0] - self.own.segment_displacement[:, 0])
        return found

    def friction(self, travel: float, sign: int) -> Floats:
        """Return friction times slip, of every piece."""
        found: Floats = self.own.friction_force * self.slip(travel, sign)
        return found

    def stuck(self, travel: float, sign: int, new: State) -> float:
        """Return that of pieces that the needle fills at both ends and that stick in the end."""
        assert new.slipping is not None
        sticks = new.slipping[: self.common] == 0
        return float(np.sum(self.friction(travel, sign)[: self.common][sticks]))

    def tip(self, travel: float, sign: int) -> float:
        return travel - sign * (float(self.tip_elsewhere[0]) - self.own.tip_displacement)

    def let_go(self) -> float:
        """Return lateral force times way of a tip that holds the skin at its own end only."""
        return float(self.own.tip_lateral @ self.tip_elsewhere[1:])

    def caught(self, pieces: Sequence[ContactSegment]) -> float:
        """Lateral force times gap in the other field, of pieces that the other end lacks."""
        total = 0.0
        for number in range(self.common, len(self.own.friction_force)):
            gap = _piece(self.own, number, pieces).offset + self.elsewhere[number, 1:]
            total += float(self.own.lateral_force[number] @ gap)
        return total


def _piece(state: State, number: int, pieces: Sequence[ContactSegment]) -> ContactSegment:
    if state.partial_segment is not None and number == state.full_segments:
        return state.partial_segment
    return pieces[number]


def _tip_parts(
    old: State, new: State, slips: list[float], front: float
) -> tuple[float, float, float]:
    """Return what cutting and snaps took, and what is no work: the tip's force over a gap.

    Parameters
    ----------
    old, new : State
    slips : (float, float), m
        Half the needle's way past the material at the tip, of the old and of the new state.
    front : float, m
        Length of the cut path at the step's start.
    """
    forces = np.array([old.tip_force, new.tip_force])
    if new.tip_phase not in (TipPhase.CUTTING, TipPhase.RUPTURE):
        return 0.0, 0.0, float(np.dot(forces, slips))
    # a tip that came back to the front and cut on in one step: the way to the front is no cut
    cut, drawn = 1.0, max(front - old.inserted_length, 0.0)
    if old.tip_phase in (TipPhase.RETRACTED, TipPhase.OUTSIDE) and drawn > 0.0:
        cut = (new.inserted_length - front) / (new.inserted_length - old.inserted_length)
    excess = np.array([max(s.tip_force - s.cutting_force, 0.0) for s in (old, new)])
    shares = np.array([1.0, cut]) * slips
    apart = float(np.dot(forces, slips - shares))
    return float(np.dot(forces - excess, shares)), float(np.dot(excess, shares)), apart


def _penalty_energy(state: State, pieces: Sequence[ContactSegment]) -> float:
    compliances = [_piece(state, n, pieces).compliance for n in range(len(state.friction_force))]
    return 0.5 * float(np.array(compliances) @ np.sum(state.lateral_force**2, axis=1))


def _stick(state: State, pieces: Sequence[ContactSegment]) -> float:
    """Return the energy of sticking as if it gave way like the lateral hold."""
    compliances = [_piece(state, n, pieces).compliance for n in range(len(state.friction_force))]
    return 0.5 * float(np.array(compliances) @ state.friction_force**2)


def _strain(state: State) -> float:
    forces = np.column_stack([state.friction_force, state.lateral_force])
    return (
        0.5 * float(np.sum(forces * state.segment_displacement))
        + 0.5 * state.tip_force * state.tip_displacement
    )
