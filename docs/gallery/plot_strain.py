"""
Strain of the tissue around a needle
====================================

The prostate of the paper with the needle inserted. The organ is stiffer than the tissue around it
and is loaded at its lower half, so that it rotates: the target moves away from the
line of the needle.
"""

import needlefem as nf
from needlefem.plotting import RenderOptions

scene = nf.load_case("../../cases/prostate-2003/case.toml")
insertion = nf.simulate(scene)

# %%
# The colour is the largest principal strain. Friction drags the tissue along the shaft. Above a
# strain of 30 % a warning states that the displacements are indicative only.

nf.render(insertion, "out/strain.png", depth=0.04, shot=RenderOptions(field="strain"))

# %%
# The same state as a synthetic ultrasound image. The name of an image file as the texture shows
# that image instead.

nf.render(insertion, "out/ultrasound.png", depth=0.04, shot=RenderOptions(texture="synthetic"))
