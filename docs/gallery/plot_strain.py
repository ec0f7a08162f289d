"""
What a needle does to the tissue around it
==========================================

The paper's prostate with the needle in. The organ is stiffer than what is around it and is pushed
at its lower half, so that it turns: the target is carried away from the needle's line.
"""

import needlefem as nf
from needlefem.plotting.render import RenderOptions

scene = nf.load_case("../../cases/prostate-2003/case.toml")
insertion = nf.simulate(scene)

# %%
# Coloured by the largest principal strain. Along the shaft friction drags the tissue along. From
# 30 % on the package warns that displacements there are indicative.

nf.render(insertion, "out/strain.png", depth=0.04, shot=RenderOptions(field="strain"))

# %%
# The same as an ultrasound image would show it. The image is made up; an own one is given by its
# file's name.

nf.render(insertion, "out/ultrasound.png", depth=0.04, shot=RenderOptions(texture="synthetic"))
