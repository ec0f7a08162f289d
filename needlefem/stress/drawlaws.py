"""Random constants of the laws of tissue, all of them admissible."""

from typing import Any

import numpy as np

from needlefem.errors import CaseError
from needlefem.materials import law_class
from needlefem.stress.drawncase import DrawnQuantity

LEAST_EIGENVALUE = 0.02
"""Of the compliance over its largest: the laws that are drawn are well away from the limits."""


def draw_law(
    random: np.random.Generator, law: str, modulus: float, limit: float, duration: float
) -> dict[str, Any]:
    """Return the table of a material.

    Parameters
    ----------
    random : Generator
    law : str
        Its name in a case.
    modulus : float, Pa
        Young's modulus, about.
    limit : float
        Largest Poisson's ratio that the element takes without locking.
    duration : float, s
        Of the insertion: relaxation times are a tenth of it to ten times as long.
    """
    if law in ("transversely-isotropic", "orthotropic"):
        while True:
            drawn = _transverse(random) if law.startswith("transversely") else _orthotropic(random)
            plain = {key: modulus * x if key in _PRESSURES else x for key, x in drawn.items()}
            try:
                values = np.linalg.eigvalsh(law_class(law, "materials")(**plain).compliance())
            except CaseError:  # constants that would release energy
                continue
            if values[0] > LEAST_EIGENVALUE * values[-1]:
                break
        written = {
            key: DrawnQuantity(float(value), "pressure") if key in _PRESSURES else value
            for key, value in plain.items()
        }
        written["density"] = DrawnQuantity(1000.0, "density")
        return {"law": law, **{key: _listed(value) for key, value in written.items()}}
    found: dict[str, Any] = {
        "law": law,
        "youngs_modulus": DrawnQuantity(modulus, "pressure"),
        "poissons_ratio": _ratio(random, limit),
        "density": DrawnQuantity(float(random.uniform(900.0, 1100.0)), "density"),
    }
    if law == "viscoelastic":
        count = int(random.integers(1, 4))
        shares = random.uniform(0.1, 0.8) * random.dirichlet(np.ones(count))
        found["shares"] = [float(share) for share in shares]
        times = duration * 10.0 ** random.uniform(-1.0, 1.0, count)
        found["times"] = [DrawnQuantity(float(time), "time") for time in times]
    return found


def _ratio(random: np.random.Generator, limit: float) -> float:
    if limit >= 0.4999 and random.random() < 0.35:
        return float(min(limit, random.choice([0.49, 0.495, 0.499, 0.4999])))
    return float(random.uniform(0.25, min(limit, 0.49)))


_PRESSURES = (
    "modulus_along", "modulus_across", "shear_along", "modulus_1", "modulus_2", "modulus_3",
    "shear_23", "shear_13", "shear_12",
)  # fmt: skip


def _transverse(random: np.random.Generator) -> dict[str, Any]:
    return {
        "modulus_along": random.uniform(1.2, 5.0),
        "modulus_across": 1.0,
        "shear_along": random.uniform(0.25, 0.8),
        "ratio_along": float(random.uniform(0.2, 0.45)),
        "ratio_across": float(random.uniform(0.1, 0.6)),
        "fibre": _direction(random.uniform(0.0, 2.0 * np.pi)),
    }


def _orthotropic(random: np.random.Generator) -> dict[str, Any]:
    angle = random.uniform(0.0, 2.0 * np.pi)
    found: dict[str, Any] = {f"modulus_{i}": random.uniform(0.6, 3.0) for i in (1, 2, 3)}
    found |= {f"ratio_{ij}": float(random.uniform(0.1, 0.4)) for ij in ("12", "13", "23")}
    found |= {f"shear_{ij}": random.uniform(0.25, 0.8) for ij in ("23", "13", "12")}
    return found | {"axis_1": _direction(angle), "axis_2": _direction(angle + 0.5 * np.pi)}


def _direction(angle: float) -> tuple[float, float]:
    return float(np.cos(angle)), float(np.sin(angle))


def _listed(value: Any) -> Any:
    return (
        list(value) if isinstance(value, tuple) and not isinstance(value, DrawnQuantity) else value
    )
