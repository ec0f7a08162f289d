"""
With and without a plan
=======================

The same needle twice: aimed at the target as if tissue were rigid, and where a plan says.
"""

from pathlib import Path

import needlefem as nf
from needlefem.plotting.stages import draw_stages

scene = nf.load_case("../../cases/prostate-2003/case.toml")
plan = nf.plan(scene)
for name, release in (("unplanned", plan.unplanned), ("planned", plan.best)):
    height, depth = 100 * release.release_point
    print(f"{name:9s}: height {height:.3f} cm, depth {depth:.3f} cm,", end=" ")
    print(f"on this model the seed misses by {1e3 * release.placement_error:.1g} mm")

# %%
# Before insertion, the seed released, the needle out, the error; without (left) and with the plan.
# When it is released the seed is not at the target, the cross: it is in the tissue that was there
# before anything moved.

draw_stages(scene, plan, Path("out/plan.png"))
