"""When within a step a needle leaves the skin or comes back to it, in tissue that needs time.

Tissue with a memory or with inertia takes steps of a duration: where within one the needle
crosses the skin is found by taking steps from the same start that last shorter. For uncut skin
the tip's force tells on which side of the skin the needle is, for cut skin the distance of the
tip from the entry point of a needle without force. A step that ends there has contact all
through or not at all, so that friction and cutting do no work over a gap.
"""

from collections.abc import Callable

from needlefem.insertion.broyden import root_between
from needlefem.insertion.motion_schedule import TimeStep
from needlefem.insertion.progress import Progress
from needlefem.insertion.skin import holding
from needlefem.insertion.state import State, TipPhase
from needlefem.insertion.tip_phase import trial_step

FINE = 1e-4
"""Part of a step to which the time of a crossing is found."""
SHORTEST = 1e-3
"""Part of a step that what is cut off, or left, of it lasts at least."""
BISECTIONS = 8
"""Of a step at whose end tissue that friction dragged along has sprung off the needle."""


def crossing_of_uncut_skin(progress: Progress, tick: TimeStep) -> float:
    """Return when in a step the tip leaves or meets the uncut skin, as a share of the step.

    1: not before its end. A step of all its duration has begun, also afterwards.
    """
    weights, now = progress.tip_at_entry, progress.state

    def force(depth: float) -> float:
        contact = progress.contact
        return float(holding(contact, contact.trial(weights), depth)[0])

    if now.tip_phase is TipPhase.OUTSIDE:
        trial = progress.contact.trial(weights)
        first = -_outside(now) / float(trial.bare[0, 0])
    else:
        first = now.tip_force
    return _crossing(progress, tick, first, force)


def crossing_on_path(progress: Progress, tick: TimeStep) -> float:
    """Return when in a step the tip leaves its path at the skin or enters it, as a share of it.

    1: not before its end. A step of all its duration has begun, also afterwards.
    """
    now, arc = progress.state, progress.arc

    def gap(depth: float) -> float:
        equations = progress.equations()
        return equations.solve(equations.at_arc(0.0), depth, 0.0, 0.0).axial_gap

    first = _outside(now) if now.tip_phase is TipPhase.OUTSIDE else -now.inserted_length
    share = _crossing(progress, tick, first, gap)
    if now.tip_phase is TipPhase.OUTSIDE or share >= 1.0:
        return share
    low, high = share, 1.0  # is it out there, or held on to by tissue that it drags along?
    for _ in range(BISECTIONS):
        depth = _begun(progress, tick, share)
        if trial_step(progress.equations(), now.tip_phase, arc, depth).way is TipPhase.OUTSIDE:
            high = share
            if share == low:
                break
        else:
            low = share
        share = 0.5 * (low + high)
    _begun(progress, tick, 1.0)
    return high if high < 1.0 - SHORTEST else 1.0


def _outside(state: State) -> float:
    """Return how far outside the entry point a tip is that touches nothing, m."""
    return state.tip_displacement - state.depth


def _begun(progress: Progress, tick: TimeStep, share: float) -> float:
    """Begin a step of a share of the tick's duration; return the depth at its end, m."""
    now = progress.state
    progress.begin(tick.duration if share == 1.0 else share * (tick.time - now.time))
    return now.depth + share * (tick.depth - now.depth)


def _crossing(
    progress: Progress, tick: TimeStep, first: float, measure: Callable[[float], float]
) -> float:
    """Return the share of a step at which a measure of depth, in a step as long, changes sign."""

    def value(share: float) -> float:
        return first if share == 0.0 else measure(_begun(progress, tick, share))

    last = value(1.0)
    if first * last >= 0.0 or abs(first) <= FINE * abs(last):
        return 1.0
    share = root_between(value, 0.0, 1.0, FINE)
    _begun(progress, tick, 1.0)
    return 1.0 if share > 1.0 - SHORTEST else max(share, SHORTEST)
