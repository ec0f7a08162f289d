"""Every registered element, law and integrator is accepted by a case or refused in a sentence."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import needlefem
from needlefem.dynamics import NAMES
from needlefem.elements import CATALOGUE
from needlefem.errors import CaseError, CheckFailedError
from needlefem.insertion import Insertion, Status
from needlefem.materials import LAWS, example
from needlefem.planning import Plan, PlanStatus
from needlefem.scene import DYNAMIC
from needlefem.units import UNITS
from needlefem.validation import parameter_info

CASE = """
schema_version = 2
title = "block"
axes = ["y", "z"]
mesh = {{ size = ["6 cm", "4 cm"], divisions = [12, 8], pattern = "{pattern}" }}
tissue = {{ default_material = "gel" }}
materials.gel = {{ law = "{law}", density = "1000 kg/m^3", {constants} }}
supports.walls = {{ faces = ["y_min", "y_max", "z_max"] }}
discretization = {{ {numbers}, path_spacing = "3 mm" }}
needle = {{ tip_radius = "5 mm", cutting_force = "30 N/m", shaft_friction = "1 kPa" }}
motion = {{ direction = [0.0, 1.0], max_depth = "1.5 cm", speed = "5 cm/s", entry = {entry} }}
target = {{ point = ["2.9 cm", "0.8 cm"] }}
"""
ENTRY = '["3.1 cm", "0 cm"]'
PATTERNS = {"diagonal": "triangle", "quadrilateral": "quadrilateral"}
"""Cells of the block, by its pattern."""
MASSES = ("consistent", "row-sum", "hrz")


def constants(law: str) -> str:
    """Return example constants of a law as a case has them."""
    found = []
    material = example(law, {})
    for field in dataclasses.fields(material):
        if field.name == "density":
            continue
        value, declared = getattr(material, field.name), parameter_info(field)
        units = UNITS.get((declared and declared.dimension) or "", {})
        unit = next((name for name, factor in units.items() if factor == 1.0), "")
        parts = [f'"{x} {unit}"' if unit else str(x) for x in np.atleast_1d(value)]
        found.append(f"{field.name} = " + (f"[{', '.join(parts)}]" if np.ndim(value) else parts[0]))
    return ", ".join(found)


def case_of(folder: Path, **values: str) -> Path:
    """Write the small case, with other values in it."""
    law = values.get("law", "isotropic")
    numbers = [
        f'{key} = "{values[key]}"'
        for key in ("element", "integrator", "mass_matrix")
        if key in values
    ]
    numbers += ['time_step = "25 ms"'] if values.get("integrator") in DYNAMIC else []
    text = CASE.format(
        pattern=values.get("pattern", "diagonal"),
        law=law,
        constants=constants(law),
        numbers=", ".join(numbers or ['element = "auto"']),
        entry=ENTRY,
    )
    path = folder / "case.toml"
    path.write_text(text)
    return path


def sentence_of(error: CaseError | CheckFailedError) -> str:
    """Return a refusal, which names what is refused and says what to do, in two lines at most."""
    text = str(error)
    assert 30 < len(text) < 400, text
    assert text.count("\n") <= 1, text
    assert "Traceback" not in text
    if isinstance(error, CaseError):
        assert error.key, text
        assert error.problem, text
        assert error.remedy, text
    return text


def simulated(case: Path) -> Insertion | str:
    """Return the insertion of a case, or the sentence that refuses it; raise any other error."""
    try:
        insertion = needlefem.simulate(case)
    except (CaseError, CheckFailedError) as refused:
        return sentence_of(refused)
    assert insertion.outcome.status is Status.COMPLETED, insertion.outcome.sentence
    assert np.isfinite(insertion.tips).all()
    return insertion


def planned(case: Path) -> Plan | str:
    """Return the plan of a case, or the sentence that refuses it; raise any other error."""
    try:
        plan = needlefem.plan(case)
    except (CaseError, CheckFailedError) as refused:
        return sentence_of(refused)
    assert plan.status is PlanStatus.PLANNED, plan.sentence
    assert plan.best.placement_error < 1e-6
    return plan


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("element", ["auto", *CATALOGUE])
def test_elements(element: str, pattern: str, tmp_path: Path) -> None:
    """An element is accepted on its own cells, and refused on others by its name."""
    case = case_of(tmp_path, element=element, pattern=pattern)
    for answer in (simulated(case), planned(case)):
        if element == "auto" or CATALOGUE[element].cell == PATTERNS[pattern]:
            assert not isinstance(answer, str), answer
        else:
            assert isinstance(answer, str)
            assert element in answer


@pytest.mark.parametrize("mass", MASSES)
@pytest.mark.parametrize("element", CATALOGUE)
def test_masses_of_elements(element: str, mass: str, tmp_path: Path) -> None:
    pattern = {cell: pattern for pattern, cell in PATTERNS.items()}[CATALOGUE[element].cell]
    values = {"element": element, "pattern": pattern, "integrator": DYNAMIC[-1]}
    answer = simulated(case_of(tmp_path, **values, mass_matrix=mass))
    if mass in ("consistent", *CATALOGUE[element].lumpings):
        assert not isinstance(answer, str), answer
    else:
        assert isinstance(answer, str)
        assert mass in answer


@pytest.mark.parametrize("integrator", ["auto", "path_following", "quasi_static", *DYNAMIC])
@pytest.mark.parametrize("law", LAWS)
def test_laws(law: str, integrator: str, tmp_path: Path) -> None:
    """A law is accepted with every integrator, save memory by one that knows no time."""
    case = case_of(tmp_path, law=law, integrator=integrator)
    answers = [simulated(case), planned(case)]
    if law == "viscoelastic" and integrator == "path_following":
        assert all(isinstance(answer, str) for answer in answers)
    else:
        assert not any(isinstance(answer, str) for answer in answers), answers


@pytest.mark.parametrize("integrator", NAMES)
def test_integrators(integrator: str, tmp_path: Path) -> None:
    case = case_of(tmp_path, integrator=integrator)
    for answer in (simulated(case), planned(case)):
        if isinstance(answer, str):
            assert integrator in answer
            assert "tissue without a needle" in answer
        else:
            chosen = answer.scene if isinstance(answer, Insertion) else answer.insertion.scene
            assert chosen.discretization.integrator == integrator.replace("-", "_")


@pytest.mark.parametrize("key", ["element", "integrator", "law"])
def test_names_that_are_not_registered(key: str, tmp_path: Path) -> None:
    """They are refused with the most similar name that is."""
    near = {"element": "P3", "integrator": "newmarc", "law": "isotropc"}[key]
    case = case_of(tmp_path, **{key: near} if key != "law" else {})
    if key == "law":
        case.write_text(case.read_text().replace('law = "isotropic"', f'law = "{near}"'))
    answer = simulated(case)
    assert isinstance(answer, str)
    assert near in answer
