"""Random motions of the needle, and random numbers of the integration in time."""

from typing import Any

import numpy as np

from needlefem.stress.drawncase import DrawnQuantity


def draw_motion(
    random: np.random.Generator, kind: str, depth: float, speed: float
) -> dict[str, Any]:
    """Return the keys of [motion] that a kind of motion needs; a plain push needs none.

    Parameters
    ----------
    random : Generator
    kind : str
        ``push``, ``release``, ``out and in``, ``to and fro``, ``train`` or ``table``.
    depth : float, m
        The deepest.
    speed : float, m/s
    """
    if kind == "push":
        return {}
    duration = depth / speed
    if kind == "table":
        return _table(random, depth, duration)
    stages: list[dict[str, Any]] = [{"to": _length(depth)}]
    if random.random() < 0.5:
        stages[0]["speed"] = DrawnQuantity(speed * float(random.uniform(0.5, 1.0)), "speed")
    if kind == "release":
        rest = duration * float(random.uniform(0.02, 1.0))
        stages.append({"hold": DrawnQuantity(rest, "time"), "release": "seed"})
        stages.append({"to": _length(random.choice([-0.05, 0.0, random.uniform(0, 0.8)]) * depth)})
    elif kind == "out and in":
        stages.append({"to": _length(-random.uniform(0.02, 0.2) * depth)})
        stages.append({"to": _length(random.uniform(0.4, 1.0) * depth)})
    elif kind == "to and fro":
        for _ in range(int(random.integers(1, 4))):
            stages.append({"to": _length(random.uniform(0.2, 0.9) * depth)})
            stages.append({"to": _length(random.uniform(0.5, 1.0) * depth)})
    elif kind == "train":
        count = int(random.integers(2, 5))
        pitch = depth * float(random.uniform(0.05, 0.7 / count))
        end = depth - count * pitch if random.random() < 0.5 else -0.05 * depth
        stages.append({"to": _length(end), "train": count, "pitch": _length(pitch)})
    return {"stages": stages}


def _table(random: np.random.Generator, depth: float, duration: float) -> dict[str, Any]:
    count = int(random.integers(2, 6))
    depths = random.uniform(-0.05, 0.95, count) * depth
    depths[0] = random.uniform(0.4, 1.0) * depth
    steps = np.abs(np.diff(depths, prepend=0.0)) / depth * duration
    times = np.cumsum(np.maximum(steps, 0.02 * duration) * random.uniform(0.8, 1.5, count))
    return {
        "times": [DrawnQuantity(float(time), "time") for time in (0.0, *times)],
        "depths": [_length(float(x)) for x in (0.0, *depths)],
    }


def _length(value: float) -> DrawnQuantity:
    return DrawnQuantity(float(value), "length")


def draw_time(
    random: np.random.Generator, data: dict[str, Any], integrator: str, duration: float
) -> None:
    """Set numbers of an integrator with inertia, and damping."""
    found = data["discretisation"]
    if integrator == "newmark":
        found["newmark_gamma"] = float(random.uniform(0.5, 0.8))
    else:
        found["rho_inf"] = float(random.uniform(0.2, 1.0))
    kind = random.choice(["none", "rayleigh", "ratios"])
    if kind == "rayleigh":
        data["damping"] = {
            "mass_rate": DrawnQuantity(float(random.uniform(0.0, 0.5)) / duration, "rate"),
            "stiffness_time": DrawnQuantity(float(random.uniform(0.0, 0.02)) * duration, "time"),
        }
    elif kind == "ratios":
        frequencies = np.array([1.0, random.uniform(3.0, 10.0)]) / duration
        data["damping"] = {
            "frequencies": [DrawnQuantity(float(f), "rate") for f in frequencies],
            "ratios": [float(x) for x in random.uniform(0.005, 0.1, 2)],
        }
