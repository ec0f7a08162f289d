"""
Insertion with and without a plan
=================================

The script compares an insertion that assumes rigid tissue with a planned insertion.
"""

from pathlib import Path

import needlefem as nf
from needlefem.plotting import draw_stages

scene = nf.load_case("../../cases/prostate-2003/case.toml")
plan = nf.plan(scene)
for name, release in (("unplanned", plan.unplanned), ("planned", plan.best)):
    height, depth = 100 * release.release_point
    print(f"{name:9s}: height {height:.3f} cm, depth {depth:.3f} cm,", end=" ")
    print(f"on this model the seed misses by {1e3 * release.placement_error:.1g} mm")

# %%
# The rows show the state before the insertion, the seed released, the needle retracted and the
# placement error, without a plan (left) and with a plan (right). At the release the seed is not at
# the target (cross): it is in the material that was at the target before the deformation.

draw_stages(scene, plan, Path("out/plan.png"))
