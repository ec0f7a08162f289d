"""What happens on the way of a needle: events, and what its tip lets go of."""

import dataclasses

import numpy as np
from scipy.optimize import brentq

from needlefem.arrays import Points, Vector
from needlefem.fem.interpolation import Weights
from needlefem.insertion.equations import Field
from needlefem.insertion.result import Event, Seed
from needlefem.insertion.state import State, Way
from needlefem.insertion.track import Track

CHANGES = {
    (Way.PRESSING, Way.WITHDRAWN): "withdrawal",
    (Way.CUTTING, Way.WITHDRAWN): "withdrawal",
    (Way.WITHDRAWN, Way.PRESSING): "return",
    (Way.WITHDRAWN, Way.CUTTING): "return",
    (Way.WITHDRAWN, Way.OUT): "exit",
    (Way.OUT, Way.WITHDRAWN): "entry",
}
"""What a change of the tip's way is called."""


@dataclasses.dataclass
class Deepest:
    """The moment at which the needle was deepest: depth (m), field, path length (m)."""

    depth: float
    field: Field
    length: float


class Chronicle:
    """Events and seeds of one motion.

    Parameters
    ----------
    track : Track
    field : Field
        At the start.
    timeless : bool
        Whether steps are cut where something happens.

    Attributes
    ----------
    events : list of Event
        May be emptied by who has read them.
    seeds : list of Seed
    """

    def __init__(self, track: Track, field: Field, *, timeless: bool) -> None:
        self.events: list[Event] = []
        self.seeds: list[Seed] = []
        self._track, self._timeless = track, timeless
        self._deepest = Deepest(0.0, field, 0.0)
        self._sticking = False

    def happens(self, kind: str, energy: float, at: State, name: str = "") -> None:
        """Note an event."""
        self.events.append(Event(kind, at.time, at.depth, at.tip, energy, name))

    def deepen(self, state: State, field: Field) -> None:
        """Remember the state if the needle was never deeper."""
        if state.depth >= self._deepest.depth and state.way is not Way.OUT:
            self._deepest = Deepest(state.depth, field, state.covered)

    def tell(self, old: State, new: State, spent: tuple[float, float]) -> None:
        """Note what changed from one state to the next.

        Parameters
        ----------
        old, new : State
        spent : (float, float)
            What friction, and what the tip took in the step, J (J/m in 2D).
        """
        friction, tip = spent
        if (old.way, new.way) in CHANGES and (len(old.axial) or len(new.axial)):
            # a step is cut before the tip leaves and after it arrives
            arrived = new.way in (Way.OUT, Way.PRESSING, Way.CUTTING) or not self._timeless
            took = tip + (friction if new.way is Way.OUT else 0.0)
            self.happens(CHANGES[old.way, new.way], took, new if arrived else old)
        if len(new.axial) < 2 or new.slipping is None:
            return
        slipping = np.count_nonzero(new.slipping[1:])
        if self._sticking and slipping == len(new.axial) - 1:
            self._sticking = False
            self.happens("breakaway", friction, new)
        elif not self._sticking and slipping == 0:
            self._sticking = True
            self.happens("grip", friction, new)

    def release(self, name: str, state: State, world: Vector) -> None:
        """Let the tip, at a point of the world, let go of something."""
        weights = Weights(state.tip_nodes, state.tip_weights[None])
        self.seeds.append(
            Seed(
                name=name,
                time=state.time,
                released_at=world,
                point=state.tip,
                shortcut=self._shortcut(state),
                weights=weights,
                inside=len(state.axial) > 0,
            )
        )
        self.happens("release", 0.0, state, name)

    def _shortcut(self, state: State) -> Vector:
        """Return the material that was where the tip is when the needle was deepest."""
        deepest, track = self._deepest, self._track
        instrument = track.instrument
        if state.depth >= deepest.depth or deepest.length <= 0.0:
            return state.tip

        def ahead(arc: float) -> float:
            point = track.at(arc)[1]
            moved = deepest.field.means(instrument.tip(point))[0, 0]
            return float(instrument.axis.along(point) + moved) - state.depth

        if ahead(0.0) >= 0.0 or ahead(deepest.length) <= 0.0:
            return state.tip
        return track.at(float(brentq(ahead, 0.0, deepest.length, xtol=1e-12)))[1]

    def places(self, field: Field) -> Points:
        """Return where the seeds are in the world under a field, shape (nseeds, dim), m."""
        frame = self._track.instrument.axis.frame
        found = [seed.point + field.means(seed.weights)[0] @ frame for seed in self.seeds]
        return np.array(found).reshape(-1, len(frame))
