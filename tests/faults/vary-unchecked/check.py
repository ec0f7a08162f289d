"""The same CaseError from a file, --set, vary, replace and a constructor, for the same value."""

import dataclasses
import math

import numpy as np
import pytest

import needlefem as nf
from needlefem.errors import CaseError
from needlefem.materials import Isotropic, Orthotropic, Viscoelastic
from needlefem.scene import (
    BoxMesh,
    Discretization,
    FileMesh,
    Limits,
    Motion,
    Needle,
    Planning,
    Rayleigh,
    Region,
    Stage,
    Support,
    TargetDraw,
    field_of,
    vary,
)

BOTH = {
    "needle.cutting_force": [(-1.0, '"-1 N/m"'), (math.nan, '"nan N/m"'), ("60 mm", '"60 mm"')],
    "needle.tip_radius": [(0.0, '"0 m"'), (math.inf, '"inf m"'), ([1.0], '["1 m"]'), (True, "true")],
    "needle.tip": [(3, "3"), ("round", '"round"')],
    "needle.tip_radiu": [(1e-3, '"1 mm"')],
    "motion.direction": [((0.0, 0.0), "[0, 0]"), ((1.0, 0.0, 0.0), "[1, 0, 0]"), (3, "3")],
    "motion.entry": [((0.03,), '["3 cm"]'), ((0.03, math.nan), '["3 cm", "nan m"]')],
    "motion.stages": [(3, "3"), ([3], "[3]"), ([{}], "[{}]"), ([{"too": 1}], "[{too=1}]")],
    "target.point": [((0.03,), '["3 cm"]'), ((0.03, math.inf), '["3 cm", "inf m"]'), (3, "3")],
    "planning.offset_range": [((0.1, 0.0), '["10 cm", "0 cm"]'), ((0.1,), '["10 cm"]')],
    "tissue.default_material": [("gell", '"gell"'), (3, "3")],
    "tissue.plane": [("strian", '"strian"')],
    "materials.fat.youngs_modulus": [(-1.0, '"-1 Pa"'), ([1.0], '["1 Pa"]')],
    "materials.fat.poissons_ratio": [(0.6, "0.6"), ("0.4", '"0.4"')],
    "regions.gland.material": [("gel", '"gel"'), (3, "3")],
    "supports.walls.fixed": [(("x",), '["x"]'), ("y", '"y"')],
    "supports.walls.regions": [(("glan",), '["glan"]')],
    "mesh.divisions": [((0, 3), "[0, 3]"), ((2.5, 3), "[2.5, 3]"), ((10,), "[10]"), (3, "3")],
    "discretization.integrator": [("verlet", '"verlet"'), ("central_difference", '"central_difference"')],
    "damping.frequencies": [((2.0, 10.0), '["2 1/s", "10 1/s"]')],
    "limits.steps": [(0, "0"), (2.5, "2.5")],
    "title": [(3, "3")],
    "axes": [(("y", "y"), '["y", "y"]'), (3, "3")],
}


def test_a_scene_checks_what_a_file_checks(folder, run):
    scene = nf.load_case("case.toml")
    for key, values in BOTH.items():
        for value, text in values:
            with pytest.raises(CaseError) as python:
                vary(scene, {key: value})
            with pytest.raises(CaseError) as file:
                nf.load_case("case.toml", [f"{key}={text}"])
            assert python.value.key.startswith(key), (key, value, str(python.value))
            assert file.value.key == python.value.key, (str(file.value), str(python.value))
            assert "\n" not in str(python.value)
            own = (key.startswith(("needle.", "limits.", "planning.")) and "radiu" not in key[-5:])
            if own and key != "needle.tip_radiu":
                part, _, name = key.rpartition(".")
                with pytest.raises(CaseError) as replaced:
                    dataclasses.replace(field_of(scene, part), **{name: value})
                assert str(replaced.value) == str(python.value)


def test_constructors_check(folder, run):
    wrong = {
        "needle.cutting_force": lambda: Needle(cutting_force=-1.0, shaft_friction=1.0),
        "needle.shaft_friction": lambda: Needle(cutting_force=1.0, shaft_friction="1 N"),
        "motion.direction": lambda: Motion(direction=(0.0, math.nan), max_depth=0.1),
        "motion.max_depth": lambda: Motion(direction=(0.0, 1.0), max_depth=np.nan),
        "motion.stages": lambda: Stage(),
        "motion.stages.seed_spacing": lambda: Stage(depth=0.1, seed_spacing=0.1),
        "mesh.divisions": lambda: BoxMesh(size=(1.0, 1.0, 1.0), divisions=(2, 2)),
        "mesh.cell": lambda: FileMesh(path="x.msh", unit=1.0, cell="hexagon"),
        "mesh.path": lambda: FileMesh(path=3, unit=1.0),
        "regions.NAME.contour": lambda: Region(contour=[[0, 0], [1, "a"]], material="fat"),
        "supports.NAME.faces": lambda: Support(faces="y_min"),
        "planning.offset_range": lambda: Planning(offset_range=(1.0, 0.0)),
        "planning.directions": lambda: Planning(directions=((0.0, 0.0),)),
        "discretization.tip_quadrature_points": lambda: Discretization(tip_quadrature_points=1.5),
        "damping.frequencies": lambda: Rayleigh(frequencies=(1.0, 2.0)),
        "targets.seed": lambda: TargetDraw(region="x", seed=-1),
        "limits.memory": lambda: Limits(memory="8 parsec"),
        "material.density": lambda: Isotropic(youngs_modulus=1, poissons_ratio=0.3, density=-1),
        "material.shares": lambda: Viscoelastic(
            youngs_modulus=1, poissons_ratio=0.3, shares=3, times=(1.0,)
        ),
        "material": lambda: Orthotropic(
            **{f"modulus_{i}": 1.0 for i in (1, 2, 3)},
            **{f"ratio_{i}": 0.9 for i in (12, 13, 23)},
            **{f"shear_{i}": 1.0 for i in (12, 13, 23)},
        ),
    }
    for key, make in wrong.items():
        with pytest.raises(CaseError) as caught:
            make()
        assert caught.value.key == key


def test_arrays_units_and_directions_are_accepted(folder, run):
    scene = nf.load_case("case.toml")
    given = {
        "needle.cutting_force": np.float32(50.0),
        "needle.shaft_friction": "8 kPa",
        "motion.direction": np.array([0.0, 2.0]),
        "motion.entry": np.array([0.033, 0.0]),
        "motion.stages": [{"to": "2 cm"}, Stage(dwell=1.0)],
        "target": [0.033, np.float64(0.033)],
        "mesh.divisions": np.array([8, 9]),
        "discretization.integrator": "generalised-alpha",
        "regions.gland.contour": scene.regions["gland"].contour.points,
    }
    found = vary(scene, given)
    assert found.needle.shaft_friction == 8e3
    assert type(found.needle.cutting_force) is float
    assert found.motion.direction == (0.0, 1.0)
    assert found.motion.stages == (Stage(depth=0.02), Stage(dwell=1.0))
    assert found.target == (0.033, 0.033)
    assert found.mesh.divisions == (8, 9)
    assert type(found.mesh.divisions[0]) is int
    assert found.discretization.integrator == "generalized_alpha"
    turned = dataclasses.replace(scene.motion, direction=[3.0, 4.0]).direction
    assert turned == (0.6, 0.8)


def test_a_turned_needle_goes_where_it_is_told(folder, run):
    scene = nf.load_case("case.toml")
    coarse = {"mesh.divisions": (10, 10), "motion.direction": (0.1, 1.0)}
    long = vary(scene, coarse | {"motion.direction": (1.0, 10.0)})
    one, other = nf.simulate(vary(scene, coarse)), nf.simulate(long)
    assert other.states[-1].depth == one.states[-1].depth
    assert other.tips == pytest.approx(one.tips, abs=1e-12)
