"""
What a needle does to the tissue around it
==========================================

The paper's prostate with the needle in: strain, and the same as synthetic ultrasound.
"""

import needlefem as nf
from needlefem.output.render import Shot

scene = nf.load_case("../../cases/prostate-2003/case.toml")
insertion = nf.simulate(scene)
print(insertion.outcome.status, f"{insertion.states[-1].force:.0f} N/m")

# %%
# The largest principal strain. Behind the tip it is large along the shaft, where friction drags the
# tissue along; from 30 % on the package warns that the model is beyond small strain.

nf.render(insertion, "out/strain.png", depth=0.04, shot=Shot(field="strain"))
