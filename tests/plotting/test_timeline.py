"""Moments of an insertion for pictures and snapshots."""

import numpy as np

from needlefem import simulate
from needlefem.geometry import Contour
from needlefem.plotting import Timeline
from needlefem.scene import Region, Scene, vary


def test_outlines_may_reach_out_of_the_tissue(organ: Scene) -> None:
    insertion = simulate(vary(organ, {"motion.entry": (0.0287, 0.0), "motion.max_depth": 0.01}))
    inside = insertion.scene.regions["organ"]
    corners = np.array([[0.05, 0.05], [0.07, 0.05], [0.05, 0.07]])
    regions = {"organ": inside, "partly": Region(contour=Contour(corners), material="stiff")}
    film = Timeline(_with_regions(insertion, regions))
    organ_outline, partly = film.moments([film.times[-1]])[0].contours
    assert np.abs(organ_outline - inside.contour.points).max() > 1e-6
    np.testing.assert_array_equal(partly[1:], corners[1:])


def _with_regions(insertion, regions):
    import dataclasses

    return dataclasses.replace(
        insertion, scene=dataclasses.replace(insertion.scene, regions=regions)
    )
