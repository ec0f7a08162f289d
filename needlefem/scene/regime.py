"""March, equilibrium step by step, or inertia: what a motion needs, by numbers known beforehand."""

import math
from itertools import pairwise

from needlefem.materials import branches_of, volumetric_split
from needlefem.scene import Motion, Scene

SLOW = 0.01
"""Speed of the needle over that of shear waves up to which inertia moves the seed by less than
0.01 mm (``needlefem study dynamics``)."""
SHORT = 1e-3
"""Delay by damping, as part of an insertion, up to which it does so."""


def integrator_for(scene: Scene, needs: str) -> tuple[str, str]:
    """Return the integrator that the scene needs, from numbers known beforehand, and why."""
    speed, wave, lag = fastest(scene.motion), slowest_wave(scene), damping_time(scene)
    duration = scene.motion.max_depth / speed
    if speed > SLOW * wave:
        share = f"{speed:.3g} m/s are {100 * speed / wave:.2g} % of the shear wave's"
        return "generalised-alpha", f"inertia matters, for the needle's {share}"
    if lag > SHORT * duration and math.isfinite(wave):
        share = f"{lag:.2g} s of {duration:.2g} s of insertion"
        return "generalised-alpha", f"damping matters, for it delays the tissue by {share}"
    slow = f"{speed:.3g} m/s are slow for a shear wave of {wave:.2g} m/s"
    if needs:
        return "quasi-static", f"{needs}; {slow}"
    return "march", f"an insertion begins, in elastic tissue with one friction limit; {slow}"


def fastest(motion: Motion) -> float:
    """Return the largest speed of the needle in a motion, m/s."""
    speeds = [stage.speed or motion.speed for stage in motion.stages if stage.to is not None]
    for (t0, s0), (t1, s1) in pairwise(zip(motion.times, motion.depths, strict=False)):
        speeds.append(abs(s1 - s0) / (t1 - t0) if t1 > t0 else motion.speed)
    return max(speeds, default=motion.speed) or motion.speed


def slowest_wave(scene: Scene) -> float:
    """Return the speed of the slowest shear wave, m/s; without end without mass somewhere."""
    laws = scene.materials.values()
    if not all(law.density for law in laws):
        return math.inf
    return min(math.sqrt(volumetric_split(law).shear / law.density) for law in laws)


def damping_time(scene: Scene) -> float:
    """Return the time by which damping delays the slowest motion, s.

    That is ``c / k`` of a mode with half a wave over the largest depth; of ratios ``2 zeta / w``.
    """
    said, wave = scene.damping, slowest_wave(scene)
    pairs = zip(said.frequencies, said.ratios, strict=False)
    given = [ratio / (math.pi * frequency) for frequency, ratio in pairs]
    omega = math.pi * wave / scene.motion.max_depth
    return max([*given, said.stiffness_time + said.mass_rate / omega**2])


def needs_steps(scene: Scene) -> str:
    """Return why a march can't even begin; empty if it can."""
    if any(branches_of(law, scene.dim, scene.plane) for law in scene.materials.values()):
        return "viscoelastic tissue depends on time"
    if scene.needle.static_friction > 1.0 or scene.needle.stick_stiffness > 0.0:
        return "friction depends on what slips"
    return ""
