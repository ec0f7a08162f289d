"""The state of an insertion at any time: fields, path, seeds, force."""

import dataclasses
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from needlefem._arrays import Floats, Ints, Points
from needlefem.insertion.result import Insertion
from needlefem.insertion.state import TipPhase, displacements

CHUNK = 64
"""Number of states whose displacements are computed together."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """Needle and tissue at one time.

    Parameters
    ----------
    time : float, s
    depth : float, m
    force : float, N (N/m in 2D)
        Force on the needle.
    u : array, shape (ndofs,), m
        Displacement.
    contours : tuple of arrays, shape (n, dim), m
        Outlines of the regions.
    path : array, shape (n, dim), m
        Points of the cut path in space, from the skin.
    seeds : array, shape (nseeds, dim), m
        Positions of the released seeds.
    """

    time: float
    depth: float
    force: float
    u: Floats
    contours: tuple[Points, ...]
    path: Points
    seeds: Points


class Timeline:
    """An insertion as frames; all quantities are interpolated linearly between states.

    Parameters
    ----------
    insertion : Insertion
    """

    def __init__(self, insertion: Insertion) -> None:
        self.insertion, self.model = insertion, insertion.model
        plane = insertion.scene.regions.values() if self.model.dim == 2 else ()
        self.outlines = tuple(region.contour.points for region in plane)
        place = self.model.interpolation.at
        find = self.model.interpolation.locator.find
        self._within = [find(points)[0] >= 0 for points in self.outlines]
        self._outline_weights = [
            place(points[within]) if np.any(within) else None
            for points, within in zip(self.outlines, self._within, strict=True)
        ]
        states = insertion.states
        cut = [
            n for n, s in enumerate(states) if s.tip_phase in (TipPhase.CUTTING, TipPhase.RUPTURE)
        ]
        self._cut: Ints = np.array(cut, dtype=np.intp)
        self._path = insertion.tips[self._cut]
        self._path_weights = place(self._path) if cut else None

    @cached_property
    def times(self) -> Floats:
        """Time of each state, shape (nstates,), s; with path following the time of its depth."""
        times = np.array([state.time for state in self.insertion.states])
        if times[-1] > 0.0:
            return times
        return self.insertion.depths / self.insertion.scene.motion.speed

    def time_at(self, depth: float) -> float:
        """Return the first time of the tip at a depth (m), or the time of its largest depth."""
        depths = self.insertion.depths
        after = int(np.argmax(depths >= min(depth, float(depths.max()))))
        if after == 0:
            return float(self.times[0])
        pair = slice(after - 1, after + 1)
        return float(np.interp(depth, depths[pair], self.times[pair]))

    def moments(self, times: Sequence[float] | Floats) -> list[Frame]:
        """Return the frames at given times, s; other times are moved to the ends of the motion."""
        times = np.clip(np.asarray(times, dtype=float), self.times[0], self.times[-1])
        last = len(self.times) - 1
        after = np.clip(np.searchsorted(self.times, times, side="left"), min(1, last), last)
        before = np.maximum(after - 1, 0)
        span = self.times[after] - self.times[before]
        share = np.divide(
            times - self.times[before], span, where=span > 0.0, out=np.ones(len(span))
        )
        numbers = np.unique(np.concatenate([before, after]))
        fields = self._fields(numbers)
        place = {int(n): column for column, n in enumerate(numbers)}
        return [
            self._moment(float(t), b, a, float(s), fields[:, [place[b], place[a]]])
            for t, b, a, s in zip(times, before.tolist(), after.tolist(), share, strict=True)
        ]

    def undeformed(self) -> Frame:
        """Return the frame before the first contact."""
        nothing = np.zeros((self.model.ndofs, 2))
        return self._moment(0.0, 0, 0, 0.0, nothing)

    def _moment(self, time: float, before: int, after: int, share: float, pair: Floats) -> Frame:
        mix = np.array([1.0 - share, share])
        u: Floats = pair @ mix
        nodal, states = self.model.nodal(u), self.insertion.states
        one, other = states[before], states[after]
        moved = [self._outline_moved(number, nodal) for number in range(len(self.outlines))]
        cut = int(np.searchsorted(self._cut, after if share == 1.0 else before, side="right"))
        path = self._path[:cut]
        if self._path_weights is not None:
            path = path + self._path_weights.of(nodal)[:cut]
        seeds, there = (other if share == 1.0 else one).seeds, len(one.seeds)
        if share < 1.0 and there:
            seeds = mix[0] * one.seeds + mix[1] * other.seeds[:there]
        return Frame(
            time=time,
            depth=float(mix @ [one.depth, other.depth]),
            force=float(mix @ [one.force, other.force]),
            u=u,
            contours=tuple(p + d for p, d in zip(self.outlines, moved, strict=True)),
            path=path,
            seeds=seeds,
        )

    def _outline_moved(self, number: int, nodal: Floats) -> Points:
        """Return the displacement of an outline; points outside of the tissue do not move."""
        moved = np.zeros(self.outlines[number].shape)
        weights = self._outline_weights[number]
        if weights is not None:
            moved[self._within[number]] = weights.of(nodal)
        return moved

    def _fields(self, numbers: Ints) -> Floats:
        """Return the displacements of some states, shape (ndofs, n), m."""
        parts = [
            displacements(self.insertion, numbers[i : i + CHUNK].tolist())
            for i in range(0, len(numbers), CHUNK)
        ]
        return np.hstack(parts)
