"""What happens on the way of a needle: events, and what its tip lets go of."""

import numpy as np

from needlefem._arrays import Points, Vector
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.insertion.cut_path import CutPath
from needlefem.insertion.result import Event, Seed
from needlefem.insertion.state import State, TipPhase
from needlefem.insertion.step_equations import Field

CHANGES = {
    (TipPhase.LOADING, TipPhase.RETRACTED): "withdrawal",
    (TipPhase.CUTTING, TipPhase.RETRACTED): "withdrawal",
    (TipPhase.RETRACTED, TipPhase.LOADING): "return",
    (TipPhase.RETRACTED, TipPhase.CUTTING): "return",
    (TipPhase.RETRACTED, TipPhase.OUTSIDE): "exit",
    (TipPhase.OUTSIDE, TipPhase.RETRACTED): "entry",
}
"""What a change of the tip's way is called."""


class EventLog:
    """Events and seeds of one motion.

    Parameters
    ----------
    track : CutPath
    timeless : bool
        Whether steps are cut where something happens.

    Attributes
    ----------
    events : list of Event
        May be emptied by who has read them.
    seeds : list of Seed
    """

    def __init__(self, track: CutPath, *, timeless: bool) -> None:
        self.events: list[Event] = []
        self.seeds: list[Seed] = []
        self._track, self._timeless = track, timeless
        self._way_in = [(0.0, track.instrument.axis.entry)]
        self._sticking = False

    def record(self, kind: str, energy: float, at: State, name: str = "") -> None:
        """Note an event."""
        self.events.append(Event(kind, at.time, at.depth, at.tip, energy, name))

    def record_deepest(self, state: State) -> None:
        """Remember the tip's material if the needle was never deeper."""
        if state.depth > self._way_in[-1][0] and state.tip_phase is not TipPhase.OUTSIDE:
            self._way_in.append((state.depth, state.tip))

    def record_transitions(self, old: State, new: State, spent: tuple[float, float]) -> None:
        """Note what changed from one state to the next.

        Parameters
        ----------
        old, new : State
        spent : (float, float)
            What friction, and what the tip took in the step, J (J/m in 2D).
        """
        friction, tip = spent
        if (old.tip_phase, new.tip_phase) in CHANGES and (
            len(old.friction_force) or len(new.friction_force)
        ):
            # a step is cut before the tip leaves and after it arrives
            arrived = (
                new.tip_phase in (TipPhase.OUTSIDE, TipPhase.LOADING, TipPhase.CUTTING)
                or not self._timeless
            )
            took = tip + (friction if new.tip_phase is TipPhase.OUTSIDE else 0.0)
            self.record(CHANGES[old.tip_phase, new.tip_phase], took, new if arrived else old)
        if len(new.friction_force) < 2 or new.slipping is None:
            return
        slipping = np.count_nonzero(new.slipping[1:])
        if self._sticking and slipping == len(new.friction_force) - 1:
            self._sticking = False
            self.record("breakaway", friction, new)
        elif not self._sticking and slipping == 0:
            self._sticking = True
            self.record("grip", friction, new)

    def release(self, name: str, state: State, world: Vector) -> None:
        """Let the tip, at a point of the world, let go of something."""
        weights = LinearFunctionals(state.tip_nodes, state.tip_weights[None])
        self.seeds.append(
            Seed(
                name=name,
                time=state.time,
                released_at=world,
                point=state.tip,
                shortcut=self._shortcut(state),
                weights=weights,
                inside=len(state.friction_force) > 0,
            )
        )
        self.record("release", 0.0, state, name)

    def _shortcut(self, state: State) -> Vector:
        """Return the material that was at the tip at this depth on the way in."""
        depths = np.array([depth for depth, _ in self._way_in])
        if state.depth >= depths[-1]:
            return state.tip
        tips = np.array([tip for _, tip in self._way_in])
        return np.array([np.interp(state.depth, depths, along) for along in tips.T])

    def seed_positions(self, field: Field) -> Points:
        """Return where the seeds are in the world under a field, shape (nseeds, dim), m."""
        frame = self._track.instrument.axis.frame
        found = [seed.point + field.means(seed.weights)[0] @ frame for seed in self.seeds]
        return np.array(found).reshape(-1, len(frame))
