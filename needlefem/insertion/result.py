"""Result of an insertion: states, status, events, seeds, energies, and a check of its strains."""

import dataclasses
from enum import StrEnum
from functools import cached_property

import numpy as np

from needlefem._arrays import Floats, Points, Vector
from needlefem.contact.condensed_contact import ContactSegment
from needlefem.errors import SimulationError
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.state import State, displacements
from needlefem.mesh.surface import place_text
from needlefem.needle.needle_interface import InsertionAxis, NeedleInterface
from needlefem.scene import Scene


class Status(StrEnum):
    """How an insertion ended; `docs/json.md` describes each value."""

    COMPLETED = "completed"
    STOPPED = "stopped"
    NOT_PUNCTURED = "not_punctured"
    STICK_DETECTED = "stick_detected"
    NOT_CONVERGED = "not_converged"
    LEFT_TISSUE = "left_tissue"
    NO_NODE = "no_node"


@dataclasses.dataclass(frozen=True)
class Outcome:
    """Status of an insertion, and a sentence for the user."""

    status: Status
    sentence: str


class LeftTissueError(SimulationError):
    """The tip leaves the tissue.

    Parameters
    ----------
    place : array, shape (dim,), m
        Material point at which the tip reaches the surface.
    depth : float, m
        Depth of the needle there.
    """

    def __init__(self, place: Vector, depth: float) -> None:
        super().__init__(
            f"the tip left the tissue at a depth of {100.0 * depth:.4g} cm, through its surface at "
            f"{place_text(place)}; stop before that depth, or change the entry or the direction"
        )
        self.place, self.depth = place, depth

    @property
    def outcome(self) -> Outcome:
        """Status and sentence of an insertion that ends with this error."""
        return Outcome(Status.LEFT_TISSUE, str(self))


@dataclasses.dataclass(frozen=True, eq=False)
class Event:
    """An event of an insertion.

    Parameters
    ----------
    kind : str
        ``puncture``; ``rupture``; ``retraction_start`` (the tip leaves the crack front);
        ``recontact`` (the tip is at the crack front again); ``exit``; ``entry`` (into the existing
        path); ``full_slip`` (the last segment that stuck begins to slip); ``full_stick`` (the last
        segment that slipped begins to stick); ``release``.
    time : float, s
    depth : float, m
    point : array, shape (dim,), m
        Material point at the tip.
    energy : float, J (J/m in 2D)
        Energy dissipated in the step that ends with the event, by friction, cutting or rupture.
    name : str
        Name of the seed that is released.
    """

    kind: str
    time: float
    depth: float
    point: Vector
    energy: float
    name: str = ""


@dataclasses.dataclass(frozen=True, eq=False)
class Seed:
    """A seed that the tip has released; also the place of a biopsy or an injection.

    Parameters
    ----------
    name : str
    time : float, s
    released_at : array, shape (dim,), m
        Position of the tip in space.
    point : array, shape (dim,), m
        Material point at the tip, at which the seed comes to rest.
    elastic_prediction : array, shape (dim,), m
        Material point that was at the tip at the same depth during the push. It is the rest
        position of a seed in elastic tissue, without a simulation of the retraction.
    weights : LinearFunctionals
        The displacement of the seed is ``weights.of(field)``, the mean over the tip kernel.
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
    """An advance of the tip at a fixed depth.

    Parameters
    ----------
    depth : float, m
    first, last : int
        Numbers of the states before and after the advance.
    """

    depth: float
    first: int
    last: int


@dataclasses.dataclass(frozen=True, kw_only=True)
class EnergyTerms:
    """Energies of an insertion from its first to its last state, J (J/m in 2D).

    Parameters
    ----------
    work : float
        Work on the needle.
    strain : float
        Change of the strain energy.
    lateral_penalty_energy : float
        Change of the energy stored in the lateral penalty (and in the tangential penalty).
    friction, cutting, rupture : float
        Energy dissipated by friction, by cutting, and by the tip force in excess of the cutting
        force during ruptures.
    contact_activation : float
        Work of the lateral penalty on new segments. With inertia it contains the work of friction
        on segments that begin to stick, whose velocity changes.
    strain_energy_mismatch : float
        Largest difference in a step between the change of the strain energy and the work of all
        forces on the tissue, relative to `work`.
    crack_front : float
        Zero: the tip force does no work over a gap to the crack front.
    viscoelastic : float
        Energy dissipated in Maxwell branches.
    kinetic : float
        Kinetic energy of the tissue.
    damping : float
        Energy dissipated by Rayleigh damping.
    algorithmic_dissipation : float
        Energy dissipated by the time integrator.
    total_absolute_work : float
        Sum of the absolute work of all steps.
    smallest_dissipation : float
        Smallest energy that friction, cutting or rupture dissipated in a step; negative if one of
        them added energy.
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
        """Largest energy that contact added in a step, over the total absolute work."""
        return (
            max(-self.smallest_dissipation, 0.0) / self.total_absolute_work
            if self.total_absolute_work
            else 0.0
        )

    @property
    def residual(self) -> float:
        """Residual of the energy balance, relative to the total absolute work.

        Relative to the work on the needle where the total absolute work is not known.
        """
        total = (
            self.strain
            + self.lateral_penalty_energy
            + self.friction
            + self.cutting
            + self.rupture
            + self.contact_activation
        )
        total += (
            self.crack_front
            + self.viscoelastic
            + self.kinetic
            + self.damping
            + self.algorithmic_dissipation
        )
        scale = self.total_absolute_work or abs(self.work)
        return abs(self.work - total) / scale if scale else 0.0


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Insertion:
    """One motion of the needle, and its result.

    Parameters
    ----------
    scene : Scene
        Resolved scene.
    model : TissueModel
    instrument : NeedleInterface
        The needle on its axis.
    outcome : Outcome
        How the insertion ended. The states up to the end exist for each status.
    states : tuple of State
        All states from the first contact with the skin.
    segments : tuple of ContactSegment
        Contact segments of the cut path, in the order of the arrays of the states. The first one is
        the entry point.
    ruptures : tuple of Rupture
    contact_solves : int
        Number of contact problems that were solved.
    events : tuple of Event
    seeds : tuple of Seed
    energies : EnergyTerms, optional
        Energies summed by time stepping. Those of path following are computed from the states
        (`energy_balance.energy_terms`).
    """

    scene: Scene
    model: TissueModel
    instrument: NeedleInterface
    outcome: Outcome
    states: tuple[State, ...]
    segments: tuple[ContactSegment, ...]
    ruptures: tuple[Rupture, ...]
    contact_solves: int
    events: tuple[Event, ...] = ()
    seeds: tuple[Seed, ...] = ()
    energies: EnergyTerms | None = None

    @property
    def axis(self) -> InsertionAxis:
        """The insertion axis."""
        return self.instrument.axis

    @cached_property
    def depths(self) -> Floats:
        """Depth of each state, shape (nstates,), m."""
        return np.array([state.depth for state in self.states])

    @cached_property
    def tips(self) -> Points:
        """Material point at the tip in each state, shape (nstates, dim), m."""
        return np.array([state.tip for state in self.states])

    @property
    def rupture_warnings(self) -> list[str]:
        """A sentence on the ruptures of the insertion; empty without ruptures."""
        if not self.ruptures:
            return []
        count = "once" if len(self.ruptures) == 1 else f"{len(self.ruptures)} times"
        return [f"the tip advances at a fixed depth (rupture) {count}"]

    @property
    def puncture_depth(self) -> float | None:
        """Depth of the puncture, m; None if the skin is not cut."""
        first = self.first_cut
        return None if first is None else self.states[first].depth

    @cached_property
    def first_cut(self) -> int | None:
        """Number of the first state in which the skin is cut; None if it is not cut."""
        for number, state in enumerate(self.states):
            if len(state.friction_force) or state.tip_force >= state.cutting_force:
                return number
        return None


# Strains in a state of an insertion, compared with the range of small strain.


LARGE_STRAIN = 0.3
"""Default limit of the principal strain outside the tip kernel."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class StrainCheck:
    """Strains in one state.

    Parameters
    ----------
    largest_strain : float
        Largest absolute principal strain outside the tip kernel.
    smallest_volume_ratio : float
        Smallest ``det(I + grad u)`` outside the tip kernel.
    inverted_cells : int
        Number of cells, including those in the tip kernel, with ``det(I + grad u) <= 0``.
    strain_limit : float
        Largest strain for which the case accepts small-strain results.
    """

    largest_strain: float
    smallest_volume_ratio: float
    inverted_cells: int
    strain_limit: float = LARGE_STRAIN

    @property
    def beyond_limit(self) -> bool:
        """Whether the largest strain exceeds the limit."""
        return self.largest_strain > self.strain_limit

    @property
    def headline(self) -> str:
        """Sentence on the strain limit for the first line of a result."""
        if self.beyond_limit:
            size = f"{self.largest_strain:.2g} > limit {self.strain_limit:g}"
            return f"strains beyond the model's range: yes ({size})"
        return f"strains beyond the model's range: no ({self.largest_strain:.2g})"

    def warnings(self) -> list[str]:
        """Return a sentence for each result that is not reliable."""
        found = []
        if self.beyond_limit:
            found.append(
                f"the largest strain away from the tip is {self.largest_strain:.2f}: "
                "beyond small strain, displacements there are only indicative"
            )
        if self.inverted_cells:
            found.append(
                f"{self.inverted_cells} mesh cells are inverted: the state is not physical"
            )
        return found


def validity(insertion: Insertion, state: int) -> StrainCheck:
    """Return the strain check of a state."""
    model, radius = insertion.model, insertion.scene.needle.tip_radius
    displacement = displacements(insertion, [state])[:, 0]
    gradient: Floats = model.basis.interpolate(displacement).grad  # (dim, dim, ncells, npoints)
    gradient = np.moveaxis(gradient, (0, 1), (2, 3))
    volume = np.linalg.det(np.eye(model.dim) + gradient)
    strain = np.linalg.eigvalsh(0.5 * (gradient + np.swapaxes(gradient, 2, 3)))
    where = np.moveaxis(np.asarray(model.basis.global_coordinates()), 0, 2)
    away = np.linalg.norm(where - insertion.states[state].tip, axis=2) > radius
    return StrainCheck(
        largest_strain=float(np.max(np.abs(strain[away]))),
        smallest_volume_ratio=float(np.min(volume[away])),
        inverted_cells=int(np.count_nonzero(np.min(volume, axis=1) <= 0.0)),
        strain_limit=insertion.scene.outputs.strain_limit,
    )
