"""Displacements of tissue that depends on time: the needle's forces are gone through again."""

from collections.abc import Iterator

import numpy as np

from needlefem.arrays import Floats, Ints
from needlefem.dynamics import TissueSystem
from needlefem.dynamics.steppers import StaticStepper, at_rest
from needlefem.insertion.fields import load
from needlefem.insertion.inertia import dynamic_medium
from needlefem.insertion.result import Insertion
from needlefem.scene.method import DYNAMIC

Steps = Iterator[tuple[float, Floats]]
"""Durations, s, and the needle's forces at their ends, shape (ndofs,)."""


def depends_on_time(insertion: Insertion) -> bool:
    """Say whether a state's displacement is more than what its forces do at rest."""
    return _inertial(insertion) or bool(insertion.model.branches)


def _inertial(insertion: Insertion) -> bool:
    return insertion.scene.discretisation.integrator in DYNAMIC


def gone_through(insertion: Insertion, times: Floats, numbers: Ints) -> Floats:
    """Return the displacements in some states, shape (ndofs, n), m.

    Parameters
    ----------
    insertion : Insertion
    times : array, shape (nstates,), s
    numbers : array, shape (n,)
        Of the states, in their order.
    """
    model, frame = insertion.model, insertion.axis.frame
    last = int(numbers[-1]) + 1
    steps = np.diff(times[:last], prepend=times[0])
    forces = (load(model, frame, state, insertion.pieces) for state in insertion.states[:last])
    lasting = ((float(d), f) for d, f in zip(steps, forces, strict=True) if d > 0.0)
    moved = _swung(insertion, lasting) if _inertial(insertion) else _crept(insertion, lasting)
    found, now = np.zeros((model.ndofs, len(numbers))), np.zeros(len(model.free_dofs))
    for number, step in enumerate(steps):
        if step > 0.0:
            now = next(moved)
        found[model.free_dofs[:, None], np.flatnonzero(numbers == number)] = now[:, None]
    return found


def _swung(insertion: Insertion, steps: Steps) -> Iterator[Floats]:
    """Yield what tissue with inertia does, shape (free dofs,), m."""
    medium = dynamic_medium(insertion.scene, insertion.model)
    for duration, force in steps:
        medium.begin(duration)
        medium.finish(force)
        assert medium.motion is not None
        yield medium.motion.u


def _crept(insertion: Insertion, steps: Steps) -> Iterator[Floats]:
    """Yield what tissue with a memory does, shape (free dofs,), m."""
    model, system = insertion.model, TissueSystem(insertion.model)
    motion, steppers = at_rest(system), dict[str, StaticStepper]()
    for duration, force in steps:
        key = f"{duration:.9e}"
        if key not in steppers:
            steppers[key] = StaticStepper(system, duration)
        free = force[model.free_dofs]
        motion = steppers[key].advance_under(motion, free, free)
        yield motion.u
