"""From a march to stepping: the same path, forces and displacement, seen by the other."""

import dataclasses

import numpy as np

from needlefem.insertion.cut_path import CutPath
from needlefem.insertion.path_following import PathFollowing
from needlefem.insertion.state import State
from needlefem.insertion.stepfield import ContactField


def hand_over(march: PathFollowing, track: CutPath, speed: float) -> tuple[State, ContactField]:
    """Return the last state of a march and its field; its path becomes the track's.

    Parameters
    ----------
    march : PathFollowing
        Has cut the skin.
    track : CutPath
        Empty.
    speed : float, m/s
        Of the needle on the march.
    """
    contact, state = march.contact, march.states[-1]
    limits = contact.axial
    for number, later in enumerate(march.states[2:], 1):
        track.crack_front = later.tip
        track.extend(float(limits[number]))
    track.friction_force[: len(limits)] = limits
    here = track.instrument.tip(state.tip)
    trial = contact.trial(here)
    path = np.column_stack([state.friction_force, state.lateral_force]).ravel()
    field = ContactField(contact, path, trial, np.append(state.tip_force, state.tip_lateral))
    now = dataclasses.replace(
        state,
        time=state.depth / speed,
        inserted_length=track.length,
        slipping=np.ones(len(limits), dtype=int),
        tip_displacement=float(field.means(here)[0, 0]),
        tip_nodes=here.nodes,
        tip_weights=here.rows[0],
    )
    return now, field
