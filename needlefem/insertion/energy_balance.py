"""Energy balance of an insertion: the work of the needle, and each term from its own definition.

Path following: the dissipation of the tip over a step from state 0 to state 1 is ``mean(R) e.dX``
plus the work of R against the displacement gradient along dX. With the gradient term written as
``ubar(X1) - ubar(X0)``, each field weighted by the force of the other state, the balance is an
identity. With the trapezoidal rule it closes to second order in each step: an independent check.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from needlefem._arrays import Floats
from needlefem.contact.condensed_contact import ContactSegment
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.insertion.result import EnergyTerms, Insertion, Rupture
from needlefem.insertion.state import State, TipPhase, displacements, loads, means_of

if TYPE_CHECKING:
    from needlefem.insertion.step_equations import Field

SUMMED = ("work", "strain", "lateral_penalty_energy", "friction", "cutting", "rupture",
          "contact_activation")  # fmt: skip
"""Terms of a time step that are added up."""


# Kernel: energy balance of an insertion.
#     W = dE + dP + F + C + R + A
# W    work on the needle, sum of mean(force) ds, J (J/m in 2D)
# dE   strain energy, u1.K u1 / 2 - u0.K u0 / 2
# dP   lateral penalty, lambda^2 / (2 kappa w)
# F    friction, mean(t) (ds - du.e)
# C, R cutting and rupture: work of the tip force R against dX in the mean of both fields
# A    contact activation, lambda gap / 2 of new segments
# Source: docs/theory.md, equations (12) to (17).
def energy_terms(insertion: Insertion, *, trapezoidal: bool = False) -> EnergyTerms:
    """Return the energy terms of an insertion; time stepping has summed its own.

    Parameters
    ----------
    insertion : Insertion
    trapezoidal : bool
        Integrate the gradient part of the tip's dissipation by the trapezoidal rule.
    """
    if insertion.energies is not None and not trapezoidal:
        return insertion.energies
    numbers = range(len(insertion.states))
    force = loads(insertion, numbers)
    moved = insertion.model.solve(force)
    energy = insertion.model.stiffness.energy(moved)
    along = _axial(insertion, moved)
    steps = [
        _Step(insertion, number, moved[:, number : number + 2], along[:, number : number + 2])
        for number in range(len(insertion.states) - 1)
    ]
    works = [step.work for step in steps]
    work, turnover = float(sum(works)), float(np.abs(works).sum())
    on_tissue = 0.5 * np.einsum("ij,ij->j", force[:, 1:] + force[:, :-1], np.diff(moved, axis=1))
    tip = [step.tip(trapezoidal=trapezoidal) for step in steps]
    rubbed = [step.friction() for step in steps]
    taken = [(f, c, s, f + c + s) for f, (c, s) in zip(rubbed, tip, strict=True)]
    return EnergyTerms(
        work=work,
        strain=float(energy[-1] - energy[0]),
        lateral_penalty_energy=_hold(insertion, insertion.states[-1])
        - _hold(insertion, insertion.states[0]),
        friction=float(sum(rubbed)),
        cutting=float(sum(pair[0] for pair in tip)),
        rupture=float(sum(pair[1] for pair in tip)),
        contact_activation=float(sum(step.capture() for step in steps)),
        total_absolute_work=turnover,
        smallest_dissipation=min((min(parts) for parts in taken), default=0.0),
        strain_energy_mismatch=float(np.max(np.abs(np.diff(energy) - on_tissue)) / work)
        if work
        else 0.0,
    )


def released(insertion: Insertion, snap: Rupture) -> float:
    """Return the energy that a snap of a march set free, J (J/m in 2D)."""
    moved = displacements(insertion, range(snap.first, snap.last + 1))
    along = np.zeros((0, moved.shape[1]))  # of the tip's work alone
    steps = [
        _Step(insertion, snap.first + n, moved[:, n : n + 2], along[:, n : n + 2])
        for n in range(snap.last - snap.first)
    ]
    return float(sum(step.tip(trapezoidal=False)[1] for step in steps))


def _axial(insertion: Insertion, moved: Floats) -> Floats:
    """Return the mean axial displacement of all pieces in all states, shape (npieces, nstates)."""
    pieces, model = insertion.pieces, insertion.model
    if not pieces:
        return np.zeros((0, moved.shape[1]))
    nodes, means = means_of(pieces)
    dofs, direction = model.node_dofs[nodes], insertion.axis.direction
    found: Floats = means @ sum(moved[dofs[:, i]] * direction[i] for i in range(model.dim))
    return found


def _hold(insertion: Insertion, state: State) -> float:
    compliance = np.array(
        [piece.compliance for piece in insertion.pieces[: len(state.friction_force)]]
    )
    return 0.5 * float(compliance @ np.sum(state.lateral_force**2, axis=1))


class _Step:
    """One step between states `number` and `number + 1`.

    `moved` are all dofs in both, `along` the pieces' axial displacements.
    """

    def __init__(self, insertion: Insertion, number: int, moved: Floats, along: Floats) -> None:
        self._along = along
        self.insertion, model = insertion, insertion.model
        self.old, self.new = insertion.states[number], insertion.states[number + 1]
        self.fields = [model.nodal(moved[:, 0]), model.nodal(moved[:, 1])]
        self.travel = self.new.depth - self.old.depth

    @property
    def work(self) -> float:
        return 0.5 * (self.old.force + self.new.force) * self.travel

    def _moved(self, number: int) -> Floats:
        """Displacement of a piece in both states in the needle's frame, shape (2, dim)."""
        piece = self.insertion.pieces[number]
        means = [piece.weights @ field[piece.nodes] for field in self.fields]
        return np.array(means) @ self.insertion.axis.frame.T

    def friction(self) -> float:
        """Mean traction times relative slip of all pieces."""
        count = len(self.new.friction_force)
        pull = self.new.friction_force.copy()
        pull[: len(self.old.friction_force)] += self.old.friction_force
        slip = self.travel - np.diff(self._along[:count], axis=1)[:, 0]
        return 0.5 * float(pull @ slip)

    def capture(self) -> float:
        """Work of the hold on the newest pieces, counted as spent (see the module)."""
        total = 0.0
        for number in range(len(self.old.friction_force), len(self.new.friction_force)):
            gap = self.insertion.pieces[number].offset + self._moved(number)[0, 1:]
            total += 0.5 * float(self.new.lateral_force[number] @ gap)
        return total

    def tip(self, *, trapezoidal: bool) -> tuple[float, float]:
        """Dissipation at the tip: of cutting, and of the excess force while it jumps."""
        gain = self._gradient_part() if trapezoidal else self._difference_part()
        ahead = float(self.insertion.axis.direction @ (self.new.tip - self.old.tip))
        cutting = np.array([self.old.cutting_force, self.new.cutting_force])
        force = np.array([self.old.tip_force, self.new.tip_force])
        excess = force - cutting
        if not np.any(self.old.tip != self.new.tip):
            return 0.0, 0.0
        spent = [0.5 * float(r.sum() * ahead + r @ gain) for r in (cutting, excess)]
        return spent[0], spent[1]

    def _difference_part(self) -> Floats:
        """``e.(ubar(X1) - ubar(X0))`` in the new field (for the old force) and the old one."""
        direction, (old, new) = self.insertion.axis.direction, (self.old, self.new)
        ahead = [
            (new.tip_weights @ field[new.tip_nodes] - old.tip_weights @ field[old.tip_nodes])
            @ direction
            for field in self.fields
        ]
        return np.array(ahead[::-1], dtype=float)

    def _gradient_part(self) -> Floats:
        """``e.grad(ubar) dX`` at the old and the new tip, each in its own field."""
        path = self.new.tip - self.old.tip
        length = float(np.linalg.norm(path))
        direction = self.insertion.axis.direction
        rates = []
        for state, field in zip((self.old, self.new), self.fields, strict=True):
            small = 1e-3 * path
            mean = self.insertion.instrument.tip
            ahead, behind = mean(state.tip + small), mean(state.tip - small)
            rates.append(float((ahead.of(field) - behind.of(field))[0] @ direction) / 2e-3)
        return np.array(rates) if length else np.zeros(2)


# Energy balance of any motion, step by step and in constant memory.
#
# Forces enter with their mean over a step. A segment that the needle fills in part is another
# functional at the end of the step: its friction is that of both slips, and its lateral penalty
# adds or removes ``force x gap / 2``. The tip force is unilateral, ``R >= 0, gap >= 0, R gap = 0``.
# Where the gap opens or closes within a step, the work over the gap (``apart``) is not work on the
# tissue and is subtracted.


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
    lateral_penalty_energy: float
    friction: float
    cutting: float
    rupture: float
    contact_activation: float
    caught: float
    strain_energy_mismatch: float

    @property
    def tip(self) -> float:
        """What the tip took."""
        return self.cutting + self.rupture

    @property
    def smallest_dissipation(self) -> float:
        """The least that friction, cutting, a snap or all together took: none may give.

        Not counted is the lateral hold, which is elastic: it gives back what it stored.
        """
        return min(
            self.friction, self.cutting, self.rupture, self.friction + self.tip + self.caught
        )


@dataclasses.dataclass
class EnergyBalance:
    """Energies since the first state, J (J/m in 2D).

    Parameters
    ----------
    pieces : sequence of ContactSegment
        Those of the whole path; their number may grow.
    give : float
        Compliance of the tangential penalty over that of the lateral penalty.
    inertial : bool
        Whether the velocity may jump when a segment sticks (contact activation).

    Attributes
    ----------
    smallest_dissipation : float
        Smallest `EnergyIncrement.smallest_dissipation`.
    largest_mismatch : float
        Largest difference of a step's work from all that it was spent on (elastic tissue).
    total_absolute_work : float
    """

    pieces: Sequence[ContactSegment]
    give: float = 0.0
    inertial: bool = False
    work: float = 0.0
    strain: float = 0.0
    lateral_penalty_energy: float = 0.0
    friction: float = 0.0
    cutting: float = 0.0
    rupture: float = 0.0
    contact_activation: float = 0.0
    viscoelastic: float = 0.0
    kinetic: float = 0.0
    damping: float = 0.0
    algorithmic_dissipation: float = 0.0
    smallest_dissipation: float = 0.0
    largest_mismatch: float = 0.0
    total_absolute_work: float = 0.0

    def weigh(
        self, old: State, new: State, fields: tuple["Field", "Field"], front: float
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
            work=work, strain=strain, lateral_penalty_energy=hold, friction=friction,
            cutting=cutting, rupture=snap,
            contact_activation=capture + caught, caught=caught, strain_energy_mismatch=mismatch,
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
        """Return twice the energy of the tangential penalty of a contact segment."""
        piece = _piece(state, number, self.pieces)
        return self.give * piece.compliance * float(state.friction_force[number]) ** 2

    def add(self, spent: EnergyIncrement) -> None:
        """Add the energies of a time step."""
        for name in SUMMED:
            setattr(self, name, getattr(self, name) + getattr(spent, name))
        self.total_absolute_work += abs(spent.work)
        self.largest_mismatch = max(self.largest_mismatch, abs(spent.strain_energy_mismatch))
        self.smallest_dissipation = min(self.smallest_dissipation, spent.smallest_dissipation)

    def begin(self, found: EnergyTerms) -> None:
        """Start from the energies of path following."""
        for name in SUMMED:
            setattr(self, name, getattr(found, name))
        self.total_absolute_work, self.largest_mismatch = (
            found.total_absolute_work,
            found.strain_energy_mismatch * abs(found.work),
        )
        self.smallest_dissipation = min(found.smallest_dissipation, 0.0)

    def set_tissue(self, energies: Mapping[str, float]) -> None:
        """Take the tissue's energies, stored and lost, from a medium that knows them."""
        if not energies:
            return
        self.strain, self.largest_mismatch = energies["strain"] + energies["stored"], 0.0
        self.viscoelastic = energies.get("relaxation", 0.0)
        self.kinetic, self.damping = energies.get("kinetic", 0.0), energies.get("damping", 0.0)
        self.algorithmic_dissipation = energies.get("algorithmic", 0.0)

    def energy_terms(self) -> EnergyTerms:
        """Return the energies."""
        return EnergyTerms(
            work=self.work,
            strain=self.strain,
            lateral_penalty_energy=self.lateral_penalty_energy,
            friction=self.friction,
            cutting=self.cutting,
            rupture=self.rupture,
            contact_activation=self.contact_activation,
            viscoelastic=self.viscoelastic,
            kinetic=self.kinetic,
            damping=self.damping,
            algorithmic_dissipation=self.algorithmic_dissipation,
            total_absolute_work=self.total_absolute_work,
            smallest_dissipation=self.smallest_dissipation,
            strain_energy_mismatch=self.largest_mismatch / self.total_absolute_work
            if self.total_absolute_work
            else 0.0,
        )


class _Side:
    """The functionals with a force at one end of a step, in the fields of both ends."""

    def __init__(
        self, own: State, other: "Field", pieces: Sequence[ContactSegment], at_other: State
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
