"""
Insertion with a dwell
======================

Force on a needle during insertion, dwell, further insertion and retraction, in a gel with static
friction above kinetic friction and slip weakening.
"""

from pathlib import Path

import needlefem as nf
from needlefem.materials import Isotropic
from needlefem.plotting import draw_forces, draw_sticking
from needlefem.scene import BoxMesh, Discretization, Motion, Needle, Scene, Stage, Support

scene = Scene(
    title="gel",
    axes=("y", "z"),
    mesh=BoxMesh(size=(0.06, 0.06), divisions=(20, 20)),
    materials={"gel": Isotropic(youngs_modulus=30e3, poissons_ratio=0.45)},
    default_material="gel",
    regions={},
    supports={"walls": Support(faces=("y_min", "y_max", "z_max"))},
    discretization=Discretization(element="P1", path_spacing=3e-3),
    needle=Needle(
        tip_radius=3e-3,
        cutting_force=50.0,
        shaft_friction=8e3,
        static_friction_ratio=1.5,
        slip_weakening_distance=1e-3,
    ),
    motion=Motion(
        direction=(0.0, 1.0),
        entry=(0.0287, 0.0),
        max_depth=0.03,
        stages=(Stage(depth=0.015), Stage(dwell=2.0), Stage(depth=0.028), Stage(depth=-1e-3)),
    ),
)
insertion = nf.simulate(scene)
for event in insertion.events:
    print(f"{event.time:5.2f} s  {1e3 * event.depth:5.1f} mm  {event.kind}")

# %%
# The total force and the tip force: the force has a peak when the motion continues after the dwell.

draw_forces(insertion, Path("out/force.png"))

# %%
# Sticking and slipping parts of the path.

draw_sticking(insertion, Path("out/sticking.png"))
