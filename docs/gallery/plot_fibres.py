"""
Insertion into fibrous tissue
=============================

In fibrous tissue the result depends on the direction of the fibres: they cause a lateral
displacement of the tissue and of the target.
"""

import numpy as np

import needlefem as nf
from needlefem.materials import TransverselyIsotropic
from needlefem.plotting import RenderOptions
from needlefem.scene import BoxMesh, Discretization, Motion, Needle, Scene, Support, vary

muscle = TransverselyIsotropic(
    modulus_along=90e3, modulus_across=30e3, shear_along=12e3, ratio_along=0.45, ratio_across=0.6
)
scene = Scene(
    title="muscle",
    axes=("y", "z"),
    mesh=BoxMesh(size=(0.06, 0.06), divisions=(20, 20)),
    materials={"muscle": muscle},
    default_material="muscle",
    regions={},
    supports={"walls": Support(faces=("y_min", "y_max", "z_max"))},
    discretization=Discretization(element="P2", path_spacing=3e-3),
    needle=Needle(tip_radius=3e-3, cutting_force=50.0, shaft_friction=10e3),
    motion=Motion(direction=(0.0, 1.0), entry=(0.03, 0.0), max_depth=0.03),
)

# %%
# Only the direction of the fibres changes. The last column is the lateral distance of the material
# at the tip from the line of the needle.

insertions = {}
for degrees in (0, 30, 60, 90):
    angle = np.radians(degrees)
    fibre = (float(np.cos(angle)), float(np.sin(angle)))
    insertions[degrees] = nf.simulate(vary(scene, {"materials.muscle.fibre": fibre}))
    last = insertions[degrees].states[-1]
    aside, depth = 1e3 * (last.tip - np.array([0.03, 0.0]))
    print(f"{degrees:2d} deg: {last.force:4.0f} N/m, {depth:5.2f} mm deep, {aside:+.2f} mm aside")

# %%
# Fibres across the needle (0 degrees), and at 60 degrees to it.

nf.render(
    insertions[0], "out/fibres.png", beside=insertions[60], shot=RenderOptions(field="displacement")
)
