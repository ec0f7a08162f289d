"""The outcome of an insertion."""

import dataclasses
from enum import StrEnum
from functools import cached_property

import numpy as np

from needlefem._arrays import Floats, Points, Vector
from needlefem.contact.condensed_contact import ContactSegment
from needlefem.errors import SimulationError
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.state import State
from needlefem.mesh.surface import place_text
from needlefem.needle.needle_interface import InsertionAxis, NeedleInterface
from needlefem.scene import Scene


class Status(StrEnum):
    """How an insertion ended."""

    COMPLETED = "completed"
    STOPPED = "stopped"
    NOT_PUNCTURED = "not_punctured"
    STICK_DETECTED = "stick_detected"
    NOT_CONVERGED = "not_converged"
    LEFT_TISSUE = "left_tissue"
    NO_NODE = "no_node"


@dataclasses.dataclass(frozen=True)
class Outcome:
    """A status with a sentence."""

    status: Status
    sentence: str


class LeftTissueError(SimulationError):
    """The tip leaves the tissue.

    Parameters
    ----------
    place : array, shape (dim,), m
        Where, in the undeformed tissue.
    depth : float, m
        Of the needle then.
    """

    def __init__(self, place: Vector, depth: float) -> None:
        super().__init__(
            f"the tip left the tissue at a depth of {100.0 * depth:.4g} cm, through its surface at "
            f"{place_text(place)}; stop before that depth, or change the entry or the direction"
        )
        self.place, self.depth = place, depth

    @property
    def outcome(self) -> Outcome:
        """The end of an insertion."""
        return Outcome(Status.LEFT_TISSUE, str(self))


@dataclasses.dataclass(frozen=True, eq=False)
class Event:
    """Something that happens at a moment.

    Parameters
    ----------
    kind : str
        ``puncture``, ``cutting`` (again), ``snap``, ``withdrawal``, ``return`` (to the crack
        front), ``exit``, ``entry``, ``breakaway`` (the last piece that stuck slips), ``grip``
        (the last that slipped sticks), ``release``.
    time : float, s
    depth : float, m
    point : array, shape (dim,), m
        Material point at the tip.
    energy : float, J (J/m in 2D)
        What the step took that ends there: friction, cutting, snap.
    name : str
        Of what was released.
    """

    kind: str
    time: float
    depth: float
    point: Vector
    energy: float
    name: str = ""


@dataclasses.dataclass(frozen=True, eq=False)
class Seed:
    """What the tip let go of: a seed, the place of a biopsy, an injection.

    Parameters
    ----------
    name : str
    time : float, s
    released_at : array, shape (dim,), m
        Tip in the world.
    point : array, shape (dim,), m
        Material point at the tip: where it comes to rest.
    shortcut : array, shape (dim,), m
        Material that was at the tip at the same depth on the way in: what one would take for it
        without simulating the retraction.
    weights : LinearFunctionals
        The mean displacement of what it lies in is ``weights.of(field)``.
    inside : bool
        Whether the tip was in the tissue.
    """

    name: str
    time: float
    released_at: Vector
    point: Vector
    elastic_prediction: Vector
    weights: LinearFunctionals
    inside: bool


@dataclasses.dataclass(frozen=True)
class Rupture:
    """A stretch of material that the tip jumped over at one depth.

    `first` and `last` number the states before and after the jump.
    """

    depth: float
    first: int
    last: int


@dataclasses.dataclass(frozen=True, kw_only=True)
class EnergyTerms:
    """Energies of an insertion from its first to its last state, J (J/m in 2D).

    `identity` is the largest mismatch of any step between the change of strain energy and the
    work of all forces on the tissue, relative to the needle's work. Motions that go back and
    forth have more: `relaxation` is what viscous tissue takes, `turnover` the work of all steps
    whatever its sign, `least` the least that friction, cutting or snaps took in a step. Tissue
    with inertia has `kinetic` energy, viscous `damping`, and what the integrator takes
    (`algorithmic`); what is lost as the needle catches a point that had another velocity is
    `capture`. `contact` is nothing: the tip's force does no work over a gap to the crack front.
    """

    work: float
    strain: float
    lateral_penalty_energy: float
    friction: float
    cutting: float
    rupture: float
    contact_activation: float
    strain_energy_mismatch: float
    crack_front: float = 0.0
    viscoelastic: float = 0.0
    kinetic: float = 0.0
    damping: float = 0.0
    algorithmic_dissipation: float = 0.0
    total_absolute_work: float = 0.0
    smallest_dissipation: float = 0.0

    @property
    def largest_energy_gain(self) -> float:
        """The most that friction, cutting or snaps gave in a step, relative to the turnover."""
        return (
            max(-self.smallest_dissipation, 0.0) / self.total_absolute_work
            if self.total_absolute_work
            else 0.0
        )

    @property
    def residual(self) -> float:
        """What is missing, relative to the needle's work (its turnover in any motion)."""
        spent = (
            self.strain
            + self.lateral_penalty_energy
            + self.friction
            + self.cutting
            + self.rupture
            + self.contact_activation
        )
        spent += (
            self.crack_front
            + self.viscoelastic
            + self.kinetic
            + self.damping
            + self.algorithmic_dissipation
        )
        scale = self.total_absolute_work or abs(self.work)
        return abs(self.work - spent) / scale if scale else 0.0


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Insertion:
    """What happened while the needle was pushed in.

    Parameters
    ----------
    scene : Scene
        Resolved.
    model : TissueModel
        The tissue.
    instrument : NeedleInterface
        The needle on its line.
    outcome : Outcome
        How it ended; the path so far is there whatever the status.
    states : tuple of State
        From the first touch on.
    pieces : tuple of ContactSegment
        Of the cut path, in the order of their numbers in the states. The first is the held entry
        point.
    snaps : tuple of Rupture
    evaluations : int
        Contact evaluations spent.
    events : tuple of Event
    seeds : tuple of Seed
        What was released on the way.
    energies : EnergyTerms, optional
        Of a motion that was stepped; a march's is found by `insertion.ledger`.
    """

    scene: Scene
    model: TissueModel
    instrument: NeedleInterface
    outcome: Outcome
    states: tuple[State, ...]
    pieces: tuple[ContactSegment, ...]
    ruptures: tuple[Rupture, ...]
    contact_solves: int
    events: tuple[Event, ...] = ()
    seeds: tuple[Seed, ...] = ()
    energies: EnergyTerms | None = None

    @property
    def axis(self) -> InsertionAxis:
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
        first = self.first_cut
        return None if first is None else self.states[first].depth

    @cached_property
    def first_cut(self) -> int | None:
        """Number of the state in which the skin is cut, or None."""
        for number, state in enumerate(self.states):
            if len(state.friction_force) or state.tip_force >= state.cutting_force:
                return number
        return None
