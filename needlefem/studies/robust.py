"""Placement error of a plan that is carried out on other models.

The residual of a plan on its own model is 1e-6 cm, which does not measure its accuracy. Its error
on another discretisation or with other parameters shows the error that must be expected.
"""

import numpy as np

from needlefem._table import Table
from needlefem.errors import SimulationError
from needlefem.planning.planner import carry_out, planner_of
from needlefem.scene import Scene, field_of, vary


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return the final positions of the seed for the case's plan on other models."""
    plan = planner_of(scene).plan()
    if plan.best is None:
        raise SimulationError(f"no plan to carry out: {plan.sentence}")
    elsewhere = {"the case itself": scene} | perturbed(scene)
    if other is not None:
        elsewhere[f"on '{other.title}'"] = other
    rows: list[list[object]] = []
    for name, executed in elsewhere.items():
        reach = carry_out(executed, plan)
        if reach is None:
            rows.append([name, "", "", "not reached"])
            continue
        miss = 100.0 * (reach.point - plan.target)
        rows.append(
            [name, *miss.tolist(), 100.0 * float(np.linalg.norm(reach.point - plan.target))]
        )
    return [
        Table(
            title="robust error: the case's plan, carried out on other models",
            columns=("carried out", *(f"error in {a} (cm)" for a in scene.axes), "error (cm)"),
            rows=rows,
        )
    ]


def perturbed(scene: Scene) -> dict[str, Scene]:
    """Return scenes with one parameter increased or decreased by 10 %."""
    names = {f"stiffness of {n}": f"materials.{n}.youngs_modulus" for n in scene.materials}
    names |= {"cutting force": "needle.cutting_force", "shaft friction": "needle.shaft_friction"}
    found = {}
    for name, path in names.items():
        value = field_of(scene, path)
        for sign, factor in (("+", 1.1), ("-", 0.9)):
            found[f"{name} {sign}10 %"] = vary(scene, {path: factor * value})
    return found
