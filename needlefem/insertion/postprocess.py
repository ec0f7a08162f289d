"""Results that are computed from the states of an insertion after it has ended.

The displacement of tissue with a memory or with inertia does not follow from the forces of one
state. It is computed by repeating the steps of the insertion with the stored forces. The strains
of a state show whether the assumption of small strain holds.
"""

import dataclasses
from collections.abc import Iterator
from functools import partial

import numpy as np

from needlefem._arrays import Floats, Ints
from needlefem.dynamics import TissueSystem
from needlefem.dynamics.steppers import StaticStepper, at_rest
from needlefem.errors import SimulationError
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.insertion.response_in_time import LeastRecentlyUsed, dynamic_response
from needlefem.insertion.result import Insertion
from needlefem.insertion.state import State, displacements, load
from needlefem.scene.discretization import DYNAMIC

Steps = Iterator[tuple[float, Floats]]
"""Durations, s, and the needle's forces at their ends, shape (ndofs,)."""
SAME = 1e-6
"""How far the tip's displacement may be off what the state says of it, over the largest one."""


def _inertial(insertion: Insertion) -> bool:
    return insertion.scene.discretization.integrator in DYNAMIC


def gone_through(insertion: Insertion, numbers: Ints) -> Floats:
    """Return the displacements in some states, shape (ndofs, n), m.

    Parameters
    ----------
    insertion : Insertion
        With all of its states.
    numbers : array, shape (n,)
        Of the states.

    Raises
    ------
    SimulationError
        States before are missing.
    """
    model, frame = insertion.model, insertion.axis.frame
    states = insertion.states[: int(np.max(numbers)) + 1]
    times = np.array([state.time for state in states])
    forces = (load(model, frame, state, insertion.pieces) for state in states[1:])
    steps = ((float(d), f) for d, f in zip(np.diff(times), forces, strict=True))
    moved = _swung(insertion, steps) if _inertial(insertion) else _crept(insertion, steps)
    found, now = np.zeros((model.ndofs, len(numbers))), np.zeros(len(model.free_dofs))
    for number, state in enumerate(states):
        if number:
            now = next(moved)
        asked = np.flatnonzero(numbers == number)
        if asked.size:
            found[model.free_dofs[:, None], asked] = now[:, None]
            _compare(insertion, state, found[:, asked[0]])
    return found


def _compare(insertion: Insertion, state: State, moved: Floats) -> None:
    """Raise a `SimulationError` if a displacement is not that of a state."""
    nodal = insertion.model.nodal(moved)
    tip = LinearFunctionals(state.tip_nodes, state.tip_weights[None]).of(nodal)[0]
    apart = abs(float(tip @ insertion.axis.direction) - state.tip_displacement)
    if apart > SAME * max(float(np.abs(nodal).max()), abs(state.tip_displacement)):
        raise SimulationError(
            "the displacement of tissue that depends on time can't be found again: keep all "
            "states of the insertion"
        )


def _swung(insertion: Insertion, steps: Steps) -> Iterator[Floats]:
    """Yield what tissue with inertia does, shape (free dofs,), m."""
    medium = dynamic_response(insertion.scene, insertion.model)
    now = np.zeros(len(insertion.model.free_dofs))
    for duration, force in steps:
        if duration > 0.0:
            medium.begin(duration)
            medium.finish(force)
            assert medium.motion is not None
            now = medium.motion.u
        yield now


def _crept(insertion: Insertion, steps: Steps) -> Iterator[Floats]:
    """Yield what tissue with a memory does, shape (free dofs,), m."""
    model, system = insertion.model, TissueSystem(insertion.model)
    start = motion = at_rest(system)
    steppers: LeastRecentlyUsed[str, StaticStepper] = LeastRecentlyUsed()
    stepper: StaticStepper | None = None
    for duration, force in steps:
        if duration > 0.0:
            start, step = motion, duration
            stepper = steppers.get(f"{step:.9e}", partial(StaticStepper, system, step))
        if stepper is not None:  # forces that follow at the same time act from the same start on
            free = force[model.free_dofs]
            motion = stepper.step_under_load(start, free, free)
        yield motion.u


# Strains of a state, compared with the range of small strain.


LARGE_STRAIN = 0.3
"""Principal strain outside the kernel up to which small strain is trusted, where no case says."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class StrainCheck:
    """Strains of one state.

    Parameters
    ----------
    largest_strain : float
        Largest principal strain (absolute) outside the tip's kernel.
    smallest_volume_ratio : float
        Smallest ``det(I + grad u)`` outside the tip's kernel.
    inverted_cells : int
        Cells, the kernel's among them, that the displacement turns over.
    strain_limit : float
        That the case trusts small strain with.
    """

    largest_strain: float
    smallest_volume_ratio: float
    inverted_cells: int
    strain_limit: float = LARGE_STRAIN

    @property
    def beyond_limit(self) -> bool:
        """Whether strains are larger than what the model describes."""
        return self.largest_strain > self.strain_limit

    @property
    def headline(self) -> str:
        """What the first line of a result says of strains beyond the limit."""
        if self.beyond_limit:
            size = f"{self.largest_strain:.2g} > limit {self.strain_limit:g}"
            return f"strains beyond the model's range: yes ({size})"
        return f"strains beyond the model's range: no ({self.largest_strain:.2g})"

    def warnings(self) -> list[str]:
        """Return a sentence for everything that should not be believed."""
        found = []
        if self.beyond_limit:
            found.append(
                f"the largest strain away from the tip is {self.largest_strain:.2f}: "
                "beyond small strain, take displacements there as indicative"
            )
        if self.inverted_cells:
            found.append(f"{self.inverted_cells} mesh cells fold over: the state is not physical")
        return found


def validity(insertion: Insertion, state: int) -> StrainCheck:
    """Return the validity indicators of a state."""
    model, radius = insertion.model, insertion.scene.needle.tip_radius
    moved = displacements(insertion, [state])[:, 0]
    gradient: Floats = model.basis.interpolate(moved).grad  # (dim, dim, ncells, npoints)
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
