"""Energy balance of an insertion. Each energy term is computed from its own definition.

Path following: the tip dissipates ``mean(R) e.dX`` in a step from state 0 to state 1, plus the
work of R against the displacement gradient along dX. If this gradient term is written as
``ubar(X1) - ubar(X0)``, each field weighted by the force of the other state, the balance is an
identity. With the trapezoidal rule its residual is of second order in the step: an independent
check.
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
"""Energy terms that time stepping sums over the steps."""
TISSUE = ("viscoelastic", "kinetic", "damping", "algorithmic_dissipation")
"""Energy terms that are computed from the tissue."""


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
    """Return the energy terms of an insertion.

    Those of time stepping were summed during the steps; those of path following are computed here.

    Parameters
    ----------
    insertion : Insertion
    trapezoidal : bool
        Integrate the gradient term of the dissipation at the tip by the trapezoidal rule.
    """
    if insertion.energies is not None and not trapezoidal:
        return insertion.energies
    numbers = range(len(insertion.states))
    force = loads(insertion, numbers)
    displacement = insertion.model.solve(force)
    energy = insertion.model.stiffness.energy(displacement)
    axial = _axial(insertion, displacement)
    steps = [
        _Step(
            insertion, number, displacement[:, number : number + 2], axial[:, number : number + 2]
        )
        for number in range(len(insertion.states) - 1)
    ]
    works = [step.work for step in steps]
    work, absolute_work = float(sum(works)), float(np.abs(works).sum())
    increment = np.diff(displacement, axis=1)
    on_tissue = 0.5 * np.einsum("ij,ij->j", force[:, 1:] + force[:, :-1], increment)
    tip = [step.tip(trapezoidal=trapezoidal) for step in steps]
    friction = [step.friction() for step in steps]
    dissipated = [(f, c, r, f + c + r) for f, (c, r) in zip(friction, tip, strict=True)]
    return EnergyTerms(
        work=work,
        strain=float(energy[-1] - energy[0]),
        lateral_penalty_energy=_lateral_energy(insertion, insertion.states[-1])
        - _lateral_energy(insertion, insertion.states[0]),
        friction=float(sum(friction)),
        cutting=float(sum(pair[0] for pair in tip)),
        rupture=float(sum(pair[1] for pair in tip)),
        contact_activation=float(sum(step.contact_activation() for step in steps)),
        total_absolute_work=absolute_work,
        smallest_dissipation=min((min(parts) for parts in dissipated), default=0.0),
        strain_energy_mismatch=float(np.max(np.abs(np.diff(energy) - on_tissue)) / work)
        if work
        else 0.0,
    )


def released(insertion: Insertion, rupture: Rupture) -> float:
    """Return the energy that a rupture of path following releases, J (J/m in 2D)."""
    displacement = displacements(insertion, range(rupture.first, rupture.last + 1))
    axial = np.zeros((0, displacement.shape[1]))  # only the work of the tip is needed
    steps = [
        _Step(insertion, rupture.first + n, displacement[:, n : n + 2], axial[:, n : n + 2])
        for n in range(rupture.last - rupture.first)
    ]
    return float(sum(step.tip(trapezoidal=False)[1] for step in steps))


def _axial(insertion: Insertion, displacement: Floats) -> Floats:
    """Return the mean axial displacement of all segments, shape (nsegments, nstates), m."""
    segments, model = insertion.segments, insertion.model
    if not segments:
        return np.zeros((0, displacement.shape[1]))
    nodes, means = means_of(segments)
    dofs, direction = model.node_dofs[nodes], insertion.axis.direction
    found: Floats = means @ sum(displacement[dofs[:, i]] * direction[i] for i in range(model.dim))
    return found


def _lateral_energy(insertion: Insertion, state: State) -> float:
    """Return the energy stored in the lateral penalty, J (J/m in 2D)."""
    compliance = np.array(
        [segment.compliance for segment in insertion.segments[: len(state.friction_force)]]
    )
    return 0.5 * float(compliance @ np.sum(state.lateral_force**2, axis=1))


class _Step:
    """The step of path following between states `number` and `number + 1`.

    `displacement`, shape (ndofs, 2), and `axial`, shape (nsegments, 2), are the displacement of all
    degrees of freedom and the mean axial displacement of all segments in both states, m.
    """

    def __init__(
        self, insertion: Insertion, number: int, displacement: Floats, axial: Floats
    ) -> None:
        self._axial = axial
        self.insertion, model = insertion, insertion.model
        self.old, self.new = insertion.states[number], insertion.states[number + 1]
        self.fields = [model.nodal(displacement[:, 0]), model.nodal(displacement[:, 1])]
        self.travel = self.new.depth - self.old.depth

    @property
    def work(self) -> float:
        return 0.5 * (self.old.force + self.new.force) * self.travel

    def _segment_means(self, number: int) -> Floats:
        """Return the mean displacement of a segment in both states, shape (2, dim), m."""
        segment = self.insertion.segments[number]
        means = [segment.weights @ field[segment.nodes] for field in self.fields]
        return np.array(means) @ self.insertion.axis.frame.T

    def friction(self) -> float:
        """Return the mean friction force times the relative slip, summed over the segments."""
        count = len(self.new.friction_force)
        force = self.new.friction_force.copy()
        force[: len(self.old.friction_force)] += self.old.friction_force
        slip = self.travel - np.diff(self._axial[:count], axis=1)[:, 0]
        return 0.5 * float(force @ slip)

    def contact_activation(self) -> float:
        """Return the work of the lateral penalty when it is applied to new segments with a gap."""
        total = 0.0
        for number in range(len(self.old.friction_force), len(self.new.friction_force)):
            gap = self.insertion.segments[number].offset + self._segment_means(number)[0, 1:]
            total += 0.5 * float(self.new.lateral_force[number] @ gap)
        return total

    def tip(self, *, trapezoidal: bool) -> tuple[float, float]:
        """Return the energy dissipated by cutting, and by the excess force during a rupture."""
        tissue = self._gradient_part() if trapezoidal else self._difference_part()
        ahead = float(self.insertion.axis.direction @ (self.new.tip - self.old.tip))
        cutting = np.array([self.old.cutting_force, self.new.cutting_force])
        force = np.array([self.old.tip_force, self.new.tip_force])
        excess = force - cutting
        if not np.any(self.old.tip != self.new.tip):
            return 0.0, 0.0
        energy = [0.5 * float(r.sum() * ahead + r @ tissue) for r in (cutting, excess)]
        return energy[0], energy[1]

    def _difference_part(self) -> Floats:
        """Return ``e.(ubar(X1) - ubar(X0))`` in the new field (for the old force) and the old."""
        direction, (old, new) = self.insertion.axis.direction, (self.old, self.new)
        ahead = [
            (new.tip_weights @ field[new.tip_nodes] - old.tip_weights @ field[old.tip_nodes])
            @ direction
            for field in self.fields
        ]
        return np.array(ahead[::-1], dtype=float)

    def _gradient_part(self) -> Floats:
        """Return ``e.grad(ubar) dX`` at the old and the new tip, each in its own field."""
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


# Energy balance of any motion, summed step by step without storing the states.
#
# Forces enter with their mean over a step. The functional of a partial segment changes in the step:
# its friction is the mean of (old force x slip of the old functional) and (new force x slip of the
# new functional), and its lateral penalty adds or removes ``force x gap / 2``. The tip force is
# unilateral, ``R >= 0, gap >= 0, R gap = 0``. Where the gap opens or closes within a step, the work
# over the gap (``gap_work``) is not work on the tissue and is subtracted.


@dataclasses.dataclass(frozen=True)
class EnergyIncrement:
    """Energies of one step, J (J/m in 2D). The other terms are those of `EnergyTerms`.

    Parameters
    ----------
    stick_activation : float
        Part of `contact_activation` that is due to segments that begin to stick.
    strain_energy_mismatch : float
        Work that is in none of the terms. It is zero up to round-off in elastic tissue.
    """

    work: float
    strain: float
    lateral_penalty_energy: float
    friction: float
    cutting: float
    rupture: float
    contact_activation: float
    stick_activation: float
    strain_energy_mismatch: float

    @property
    def tip(self) -> float:
        """Energy dissipated at the tip, by cutting and rupture."""
        return self.cutting + self.rupture

    @property
    def smallest_dissipation(self) -> float:
        """Smallest dissipation in the step: of friction, cutting, rupture, or of their sum.

        The sum includes `stick_activation`. A negative value means that contact adds energy. The
        energy that the lateral penalty releases is not counted, because it is elastic.
        """
        total = self.friction + self.tip + self.stick_activation
        return min(self.friction, self.cutting, self.rupture, total)


@dataclasses.dataclass
class EnergyBalance:
    """Energies of time stepping since the first state, J (J/m in 2D). Terms as in `EnergyTerms`.

    Parameters
    ----------
    segments : sequence of ContactSegment
        Contact segments of the whole cut path. The sequence grows with the path.
    penalty_ratio : float
        Compliance of the tangential penalty over that of the lateral penalty. 0: rigid sticking.
    has_inertia : bool
        Whether the velocity of a segment changes when it begins to stick.

    Attributes
    ----------
    largest_mismatch : float
        Largest absolute `EnergyIncrement.strain_energy_mismatch` of all steps.
    """

    segments: Sequence[ContactSegment]
    penalty_ratio: float = 0.0
    has_inertia: bool = False
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

    def increment(
        self, old: State, new: State, fields: tuple["Field", "Field"], front: float
    ) -> EnergyIncrement:
        """Return the energies of a step between two states.

        Parameters
        ----------
        old, new : State
        fields : (Field, Field)
            Displacement fields of both states.
        front : float, m
            Length of the cut path at the start of the step.
        """
        travel = new.depth - old.depth
        sides = (
            _Side(old, fields[1], self.segments, new),
            _Side(new, fields[0], self.segments, old),
        )
        signed = list(zip(sides, (1, -1), strict=True))
        tip = [0.5 * side.tip(travel, sign) for side, sign in signed]
        cutting, rupture, gap_work = _tip_parts(old, new, tip, front)
        work = 0.5 * (old.force + new.force) * travel - gap_work
        friction = 0.5 * sum(float(np.sum(side.friction(travel, sign))) for side, sign in signed)
        penalty = _penalty_energy(new, self.segments) - _penalty_energy(old, self.segments)
        stored = [_friction_energy(state, self.segments) for state in (old, new)]
        tangential = self.penalty_ratio * (stored[1] - stored[0])
        penalty, friction = penalty + tangential, friction - tangential
        applied = [side.lateral_activation(self.segments) for side in sides]
        activation = 0.5 * (applied[1] - applied[0])
        activation += 0.5 * (sides[1].lateral_tip_work() - sides[0].lateral_tip_work())
        strain = _strain(new) - _strain(old)
        mismatch = work - strain - friction - cutting - rupture - penalty - activation
        sticking = 0.0
        if self.has_inertia and new.tip_phase is not TipPhase.OUTSIDE and not self.penalty_ratio:
            sticking = 0.5 * sum(side.sticking_work(travel, sign, new) for side, sign in signed)
        ended = self._ended_friction(old, new, sides, travel)
        friction, activation = friction - sticking - ended, activation + ended
        return EnergyIncrement(
            work=work, strain=strain, lateral_penalty_energy=penalty, friction=friction,
            cutting=cutting, rupture=rupture, contact_activation=activation + sticking,
            stick_activation=sticking, strain_energy_mismatch=mismatch,
        )  # fmt: skip

    def _ended_friction(
        self, old: State, new: State, sides: tuple["_Side", "_Side"], travel: float
    ) -> float:
        """Return the work of friction forces that end in the step, J (J/m in 2D).

        This work is part of the contact activation. The functional of the partial segment changes
        in the step, and the segment slips with the new functional. Of its force ``f`` on the length
        ``l`` at the start, the share on the length in which the needle still is continues; the rest
        ends. The force on sticking segments that the needle leaves ends, too. If the segments keep
        the direction of their slip, all of the work is friction.
        """
        first = min(old.full_segments, new.full_segments)
        if old.slipping is None or new.slipping is None or first >= len(old.friction_force):
            return 0.0
        old_slip, total = sides[0].slip(travel, 1), 0.0
        if first < len(new.friction_force):
            new_slip = sides[1].slip(travel, -1)[first]
            continues = old.friction_force[first] * new.slipping[first] > 0.0
            if not continues or (self.has_inertia and first == old.full_segments):
                lengths = [1.0 / _segment(s, first, self.segments).compliance for s in (new, old)]
                share = 1.0 if continues else min(lengths[0] / lengths[1], 1.0)
                total += old.friction_force[first] * (old_slip[first] - share * new_slip)
                total += (1.0 - share) * self._twice_stored(old, first)
        for number in range(len(new.friction_force), len(old.friction_force)):
            if old.slipping[number] == 0:
                work = old.friction_force[number] * old_slip[number]
                total += work + self._twice_stored(old, number)
        return 0.5 * float(total)

    def _twice_stored(self, state: State, number: int) -> float:
        """Return twice the energy of the tangential penalty of a contact segment."""
        segment = _segment(state, number, self.segments)
        return self.penalty_ratio * segment.compliance * float(state.friction_force[number]) ** 2

    def add(self, increment: EnergyIncrement) -> None:
        """Add the energies of a time step."""
        for name in SUMMED:
            setattr(self, name, getattr(self, name) + getattr(increment, name))
        self.total_absolute_work += abs(increment.work)
        self.largest_mismatch = max(self.largest_mismatch, abs(increment.strain_energy_mismatch))
        self.smallest_dissipation = min(self.smallest_dissipation, increment.smallest_dissipation)

    def begin(self, found: EnergyTerms) -> None:
        """Start with the energies of path following."""
        for name in SUMMED:
            setattr(self, name, getattr(found, name))
        self.total_absolute_work, self.largest_mismatch = (
            found.total_absolute_work,
            found.strain_energy_mismatch * abs(found.work),
        )
        self.smallest_dissipation = min(found.smallest_dissipation, 0.0)

    def set_tissue(self, energies: Mapping[str, float]) -> None:
        """Set the energies that are computed from the tissue; see `TissueResponse.energies`."""
        if not energies:
            return
        self.strain, self.largest_mismatch = energies["strain"] + energies["stored"], 0.0
        self.viscoelastic = energies.get("relaxation", 0.0)
        self.kinetic, self.damping = energies.get("kinetic", 0.0), energies.get("damping", 0.0)
        self.algorithmic_dissipation = energies.get("algorithmic", 0.0)

    def energy_terms(self) -> EnergyTerms:
        """Return the energies of all steps so far."""
        names = (*SUMMED, *TISSUE, "total_absolute_work", "smallest_dissipation")
        scale = self.total_absolute_work
        return EnergyTerms(
            **{name: getattr(self, name) for name in names},
            strain_energy_mismatch=self.largest_mismatch / scale if scale else 0.0,
        )


class _Side:
    """One end of a step: its functionals with a force, evaluated in the fields of both ends.

    `own` is the state at this end; `other` and `at_other` are field and state at the other end.
    """

    def __init__(
        self, own: State, other: "Field", segments: Sequence[ContactSegment], at_other: State
    ) -> None:
        self.own = own
        self.common = min(own.full_segments, at_other.full_segments)
        elsewhere = [at_other.segment_displacement[: self.common]]
        for number in range(self.common, len(own.friction_force)):
            segment = _segment(own, number, segments)
            elsewhere.append(other.means(LinearFunctionals(segment.nodes, segment.weights[None])))
        self.elsewhere: Floats = np.concatenate(elsewhere)
        """Displacement of the own segments in the other field, shape (nsegments, dim), m."""
        tip = LinearFunctionals(own.tip_nodes, own.tip_weights[None])
        self.tip_elsewhere: Floats = other.means(tip)[0]

    def slip(self, travel: float, sign: int) -> Floats:
        """Return the slip of all segments, m; `sign` is 1 at the start of the step, else -1."""
        found: Floats = travel - sign * (self.elsewhere[:, 0] - self.own.segment_displacement[:, 0])
        return found

    def friction(self, travel: float, sign: int) -> Floats:
        """Return friction force times slip of all segments, shape (nsegments,), J (J/m in 2D)."""
        found: Floats = self.own.friction_force * self.slip(travel, sign)
        return found

    def sticking_work(self, travel: float, sign: int, new: State) -> float:
        """Return friction force times slip of the full segments that stick at the end, J."""
        assert new.slipping is not None
        sticks = new.slipping[: self.common] == 0
        return float(np.sum(self.friction(travel, sign)[: self.common][sticks]))

    def tip(self, travel: float, sign: int) -> float:
        """Return the travel of the needle relative to the material at the tip, m."""
        return travel - sign * (float(self.tip_elsewhere[0]) - self.own.tip_displacement)

    def lateral_tip_work(self) -> float:
        """Return lateral tip force (on uncut skin) times displacement at the other end, J."""
        return float(self.own.tip_lateral @ self.tip_elsewhere[1:])

    def lateral_activation(self, segments: Sequence[ContactSegment]) -> float:
        """Return lateral force times gap in the other field, of segments that only this end has."""
        total = 0.0
        for number in range(self.common, len(self.own.friction_force)):
            gap = _segment(self.own, number, segments).offset + self.elsewhere[number, 1:]
            total += float(self.own.lateral_force[number] @ gap)
        return total


def _segment(state: State, number: int, segments: Sequence[ContactSegment]) -> ContactSegment:
    if state.partial_segment is not None and number == state.full_segments:
        return state.partial_segment
    return segments[number]


def _tip_parts(
    old: State, new: State, slips: list[float], front: float
) -> tuple[float, float, float]:
    """Return the energies of cutting and rupture, and the work of the tip force over a gap.

    Parameters
    ----------
    old, new : State
    slips : (float, float), m
        Half the travel of the needle relative to the material at the tip, of both states.
    front : float, m
        Length of the cut path at the start of the step.
    """
    forces = np.array([old.tip_force, new.tip_force])
    if new.tip_phase not in (TipPhase.CUTTING, TipPhase.RUPTURE):
        return 0.0, 0.0, float(np.dot(forces, slips))
    # if the tip returns to the crack front and cuts in one step, only the second part is cutting
    cut, behind = 1.0, max(front - old.inserted_length, 0.0)
    if old.tip_phase in (TipPhase.RETRACTED, TipPhase.OUTSIDE) and behind > 0.0:
        cut = (new.inserted_length - front) / (new.inserted_length - old.inserted_length)
    excess = np.array([max(s.tip_force - s.cutting_force, 0.0) for s in (old, new)])
    shares = np.array([1.0, cut]) * slips
    gap_work = float(np.dot(forces, slips - shares))
    return float(np.dot(forces - excess, shares)), float(np.dot(excess, shares)), gap_work


def _compliances(state: State, segments: Sequence[ContactSegment]) -> Floats:
    count = len(state.friction_force)
    return np.array([_segment(state, n, segments).compliance for n in range(count)])


def _penalty_energy(state: State, segments: Sequence[ContactSegment]) -> float:
    return 0.5 * float(_compliances(state, segments) @ np.sum(state.lateral_force**2, axis=1))


def _friction_energy(state: State, segments: Sequence[ContactSegment]) -> float:
    """Return the energy that friction forces would store in the lateral penalty, J (J/m in 2D)."""
    return 0.5 * float(_compliances(state, segments) @ state.friction_force**2)


def _strain(state: State) -> float:
    forces = np.column_stack([state.friction_force, state.lateral_force])
    return (
        0.5 * float(np.sum(forces * state.segment_displacement))
        + 0.5 * state.tip_force * state.tip_displacement
    )
