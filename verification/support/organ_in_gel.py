"""A stiff disc in gel with a needle: a scene of several reference problems."""

import math
from collections.abc import Sequence

import numpy as np

from needlefem.geometry import Contour
from needlefem.materials import Isotropic
from needlefem.scene import BoxMesh, Discretization, Motion, Needle, Region, Scene, Stage, Support

SIZE, CENTRE, RADIUS = 0.06, (0.036, 0.025), 0.012
"""Side of the square, centre and radius of the organ, m."""
MODULI = {"gel": 30e3, "stiff": 90e3}
"""Young's moduli, Pa."""


def organ_in_gel(
    element: str,
    divisions: int,
    spacing: float,
    *,
    max_depth: float,
    stages: Sequence[Stage] = (),
    tip_radius: float = 3e-3,
    friction: float = 10e3,
    corners: int = 48,
) -> Scene:
    """Return a stiff disc in a square of gel that a needle passes beside its middle.

    Parameters
    ----------
    element : str
    divisions : int
        Squares along each side.
    spacing : float, m
        Path spacing.
    max_depth : float, m
    stages : sequence of Stage
        Stages of the motion; a single insertion by default.
    tip_radius : float, m
    friction : float, Pa
    corners : int
        Number of vertices of the polygon around the disc.
    """
    turn = 2.0 * np.pi * np.arange(corners) / corners
    outline = np.array(CENTRE) + RADIUS * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return Scene(
        title="organ in gel",
        axes=("y", "z"),
        mesh=BoxMesh(size=(SIZE, SIZE), divisions=(divisions, divisions)),
        materials={
            name: Isotropic(youngs_modulus=modulus, poissons_ratio=0.45)
            for name, modulus in MODULI.items()
        },
        default_material="gel",
        regions={"organ": Region(contour=Contour(outline), material="stiff")},
        supports={"walls": Support(faces=("y_min", "y_max", "z_max"))},
        discretization=Discretization(
            element=element,
            path_spacing=spacing,
            tip_quadrature_points=_points(tip_radius, divisions),
        ),
        needle=Needle(tip_radius=tip_radius, cutting_force=50.0, shaft_friction=friction),
        motion=Motion(
            direction=(0.0, 1.0), entry=(0.0287, 0.0), max_depth=max_depth, stages=tuple(stages)
        ),
    )


def _points(tip_radius: float, divisions: int) -> int:
    """Return three kernel points per element length, with which the records were made."""
    return min(400, max(48, math.ceil(math.pi * (3.0 * tip_radius * divisions / SIZE) ** 2)))
