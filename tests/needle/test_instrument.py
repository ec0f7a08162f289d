"""What the shaft lies in: means over pieces of its path, up to the skin."""

import numpy as np
import pytest

from needlefem.insertion import Simulation
from needlefem.needle import NeedleInterface
from needlefem.scene import Scene, vary


@pytest.fixture
def oblique(gel: Scene) -> NeedleInterface:
    simulation = Simulation(vary(gel, {"motion.direction": (-0.7, 1.0)}))
    return simulation.instrument(simulation.entry_of_case())


def mean(instrument: NeedleInterface, tip: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return the mean of the coordinates over the piece: of the points themselves."""
    weights = instrument.tip_and_segment(tip, last)
    nodes = instrument.interpolation._mesh.p.T
    return weights.rows[1] @ nodes[weights.nodes]


def test_the_piece_at_an_oblique_skin_moves_smoothly_with_the_tip(oblique: NeedleInterface) -> None:
    entry, direction = oblique.axis.entry, oblique.axis.direction
    lengths = np.linspace(0.2, 1.0, 801) * oblique.spacing
    means = np.array([mean(oblique, entry + length * direction, entry) for length in lengths])
    step = np.linalg.norm(np.diff(means, axis=0), axis=1)
    assert step.max() < 3.0 * (
        lengths[1] - lengths[0]
    )  # a point left out moves it by 40 times that


def test_the_piece_at_an_oblique_skin_is_the_part_in_the_tissue(oblique: NeedleInterface) -> None:
    entry, ahead = oblique.axis.entry, oblique.spacing * oblique.axis.direction
    radius = oblique.kernel.radius  # type: ignore[attr-defined]
    share, across = np.meshgrid(np.linspace(0.0, 1.0, 2001), np.linspace(-1.0, 1.0, 2001))
    lateral = oblique.axis.lateral_directions[0]
    points = entry + share[..., None] * ahead + radius * across[..., None] * lateral
    inside = (points - entry) @ oblique.inward >= 0.0
    assert 0.5 < inside.mean() < 0.95  # the skin cuts the piece
    wanted = points[inside].mean(axis=0)
    assert mean(oblique, entry + ahead, entry) == pytest.approx(wanted, abs=0.02 * radius)


def test_pieces_of_a_path_are_those_that_the_tip_leaves_behind(oblique: NeedleInterface) -> None:
    entry, ahead = oblique.axis.entry, oblique.spacing * oblique.axis.direction
    vertices = entry + np.arange(4)[:, None] * ahead
    together, nodes = oblique.segments(vertices), oblique.interpolation._mesh.p.T
    places = together.rows @ nodes[together.nodes]
    one_by_one = [mean(oblique, *vertices[[n + 1, n]]) for n in range(3)]
    assert places == pytest.approx(np.array(one_by_one), abs=1e-15)


def test_a_piece_across_an_upright_skin_is_whole(gel: Scene) -> None:
    simulation = Simulation(gel)
    instrument = simulation.instrument(simulation.entry_of_case())
    entry, ahead = instrument.axis.entry, instrument.spacing * instrument.axis.direction
    middle = entry + 0.5 * ahead
    assert mean(instrument, entry + ahead, entry) == pytest.approx(middle, abs=1e-15)
