"""Properties of a scene's needle on its mesh."""

from needlefem.checks.result import CheckResult
from needlefem.resolve import tip_element_size
from needlefem.scene import Scene


def needle_resolution(scene: Scene) -> CheckResult:
    """Check that the mesh is not blind to the needle: elements of at most four tip radii.

    Accurate answers need half a tip radius, of which `resolve` warns; beyond four radii the
    mesh alone decides where the needle goes.
    """
    return CheckResult(
        name="needle resolution",
        requirement="elements along the needle are at most four tip radii large",
        value=tip_element_size(scene) / scene.needle.tip_radius,
        bound=4.0,
    )
