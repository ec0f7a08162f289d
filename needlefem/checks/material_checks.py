"""Checks of a constitutive law by differences of its own response."""

import dataclasses

import numpy as np

from needlefem._arrays import Floats
from needlefem.checks.result import CheckResult
from needlefem.errors import CaseError
from needlefem.materials import Isotropic, Material, MaterialResponse, voigt, volumetric_split
from needlefem.materials.linear_elastic import HasBranches
from needlefem.materials.volumetric_split import HasCompliance

SMALL = 1e-5
"""Strain of the checks, and step of the differences: far above round-off, far below 1."""
DIFFERENCE = 1e-5
"""Largest relative error of central differences."""


def check_law(material: Material) -> tuple[CheckResult, ...]:
    """Return the results of all checks that apply to a law.

    The stress of an incompressible law does not follow from the strain; its compliance is checked.
    """
    always = [density(material), stable(material)]
    try:
        material.evaluate(np.zeros((3, 3)))
    except CaseError:
        return (*always, *_of_constants(material))
    return (
        *always,
        rest(material),
        stress_of_energy(material),
        tangent_of_stress(material),
        tangent_symmetric(material),
        rotation(material),
        *_of_constants(material),
        *_of_memory(material),
    )


def _trials() -> Floats:
    return SMALL * np.random.default_rng(7).uniform(-1.0, 1.0, (4, 3, 3))


def _scale(material: Material) -> float:
    return float(np.abs(_tangent(material.evaluate(np.zeros((3, 3))))).max())


def _tangent(response: MaterialResponse) -> Floats:
    return np.asarray(response.tangent, dtype=float)


def _slope(material: Material, gradient: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """Return derivatives of energy and stress along a direction of the gradient."""
    step = 0.1 * SMALL
    ahead = material.evaluate(gradient + step * direction)
    behind = material.evaluate(gradient - step * direction)
    energy = (np.asarray(ahead.energy) - np.asarray(behind.energy)) / (2.0 * step)
    stress = (np.asarray(ahead.stress) - np.asarray(behind.stress)) / (2.0 * step)
    return energy, stress


def density(material: Material) -> CheckResult:
    """Check that the density is not negative."""
    return CheckResult(
        name="density",
        requirement="mass per volume is not negative",
        value=max(0.0, -float(material.density)),
        bound=0.0,
    )


def stable(material: Material) -> CheckResult:
    """Check that each strain has a positive energy."""
    try:
        stiff = volumetric_split(material).shear > 0.0
    except (CaseError, np.linalg.LinAlgError):
        stiff = False
    return CheckResult(
        name="stability",
        requirement="each strain has a positive energy",
        value=float(not stiff),
        bound=0.0,
    )


def rest(material: Material) -> CheckResult:
    """Check that undeformed tissue has neither stress nor energy."""
    found = material.evaluate(np.zeros((3, 3)))
    worst = max(float(np.abs(found.stress).max()), abs(float(found.energy)))
    return CheckResult(
        name="rest",
        requirement="undeformed tissue has neither stress nor energy",
        value=worst / _scale(material),
        bound=1e-12,
    )


def stress_of_energy(material: Material) -> CheckResult:
    """Check that the stress is the derivative of the energy."""
    worst = 0.0
    scale = _scale(material) * SMALL
    for gradient in _trials():
        stress = np.asarray(material.evaluate(gradient).stress)
        for direction in np.eye(9).reshape(9, 3, 3):
            energy, _ = _slope(material, gradient, direction)
            worst = max(worst, abs(float(energy) - float(np.sum(stress * direction))) / scale)
    return CheckResult(
        name="stress of energy",
        requirement="the stress is the derivative of the energy",
        value=worst,
        bound=DIFFERENCE,
    )


def tangent_of_stress(material: Material) -> CheckResult:
    """Check that the tangent is the derivative of the stress, as Newton's method requires."""
    worst, scale = 0.0, _scale(material)
    for gradient in _trials():
        tangent = _tangent(material.evaluate(gradient))
        for direction in np.eye(9).reshape(9, 3, 3):
            _, stress = _slope(material, gradient, direction)
            off = stress - np.tensordot(tangent, direction, 2)
            worst = max(worst, float(np.abs(off).max()) / scale)
    return CheckResult(
        name="tangent of stress",
        requirement="the tangent is the derivative of the stress",
        value=worst,
        bound=DIFFERENCE,
    )


def tangent_symmetric(material: Material) -> CheckResult:
    """Check that the tangent has the symmetry of a second derivative."""
    tangent = _tangent(material.evaluate(_trials()[0]))
    off = np.abs(tangent - np.transpose(tangent, (2, 3, 0, 1))).max()
    return CheckResult(
        name="tangent symmetric",
        requirement="the tangent is symmetric, as a second derivative is",
        value=float(off) / _scale(material),
        bound=1e-10,
    )


def rotation(material: Material) -> CheckResult:
    """Check that an infinitesimal rotation of undeformed tissue causes no stress."""
    tangent = _tangent(material.evaluate(np.zeros((3, 3))))
    turns = np.array([[[0, 1, 0], [-1, 0, 0], [0, 0, 0]], [[0, 0, 1], [0, 0, 0], [-1, 0, 0]]])
    worst = max(float(np.abs(np.tensordot(tangent, turn, 2)).max()) for turn in turns)
    return CheckResult(
        name="rotation",
        requirement="an infinitesimal rotation causes no stress",
        value=worst / _scale(material),
        bound=1e-12,
    )


def _of_constants(material: Material) -> list[CheckResult]:
    """Return the results of the checks that depend on the declared properties of a law."""
    found = []
    if isinstance(material, HasCompliance):
        found.append(compliance(material))
    if isinstance(material, Isotropic) or getattr(material, "isotropic", False):
        found.append(isotropy(material))
    if {"youngs_modulus", "poissons_ratio"} <= {f.name for f in dataclasses.fields(material)}:  # type: ignore[arg-type]
        found.append(simple_tension(material))
    return found


def _compliance(material: Material) -> Floats:
    if isinstance(material, HasCompliance):
        return material.compliance()
    tangent = voigt.tangent_matrix(_tangent(material.evaluate(np.zeros((3, 3)))))
    return np.asarray(np.linalg.inv(tangent), dtype=float)


def compliance(material: HasCompliance) -> CheckResult:
    """Check that a compliance is symmetric, and the inverse of the (relaxed) stiffness."""
    matrix = material.compliance()
    off = float(np.abs(matrix - matrix.T).max() / np.abs(matrix).max())
    if isinstance(material, Material):
        try:
            relaxed = material.evaluate(np.zeros((3, 3)), None, np.inf)
            stiffness = voigt.tangent_matrix(_tangent(relaxed))
            spread = np.abs(stiffness) @ np.abs(matrix)
            off = max(off, float(np.max(np.abs(stiffness @ matrix - np.eye(6)) / spread.max())))
        except CaseError:
            pass  # incompressible: the stiffness does not exist
    return CheckResult(
        name="compliance",
        requirement="the compliance is symmetric and the inverse of the stiffness",
        value=off,
        bound=1e-12,
    )


def isotropy(material: Material) -> CheckResult:
    """Check that the response of a law that is declared isotropic is equal in all directions."""
    matrix = _compliance(material)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turned = voigt.rotation(turn).T @ matrix @ voigt.rotation(turn)
    return CheckResult(
        name="isotropy",
        requirement="the response does not depend on the direction",
        value=float(np.abs(turned - matrix).max() / np.abs(matrix).max()),
        bound=1e-12,
    )


def simple_tension(material: Material) -> CheckResult:
    """Check that uniaxial tension gives the declared modulus and Poisson's ratio."""
    matrix = _compliance(material)
    modulus = float(material.youngs_modulus)  # type: ignore[attr-defined]
    ratio = float(material.poissons_ratio)  # type: ignore[attr-defined]
    off = max(abs(matrix[0, 0] * modulus - 1.0), abs(matrix[1, 0] * modulus + ratio))
    return CheckResult(
        name="simple tension",
        requirement="uniaxial tension gives the declared Young's modulus and Poisson's ratio",
        value=float(off),
        bound=1e-9,
    )


def _of_memory(material: Material) -> list[CheckResult]:
    """Return the results of the checks for a viscoelastic law."""
    if not (isinstance(material, HasBranches) and material.branches()):
        return []
    return [same_in_two_steps(material), loses_energy(material)]


def _walk(material: Material, steps: int) -> tuple[Floats, Floats]:
    """Return stress and dissipation over a random strain path with several steps per segment."""
    time = float(np.median([branch.time for branch in material.branches()]))  # type: ignore[attr-defined]
    gradient, state = np.zeros((3, 3)), None
    stress, energy = np.zeros((3, 3)), 0.0
    lost = []
    for leg in SMALL * np.random.default_rng(5).normal(size=(12, 3, 3)):
        work = 0.0
        for _ in range(steps):
            found = material.evaluate(gradient + leg / steps, state, time / steps)
            work += 0.5 * float(np.sum((found.stress + stress) * leg)) / steps
            gradient, state, stress = gradient + leg / steps, found.state, np.asarray(found.stress)
        lost.append(work - (float(found.energy) - energy))
        energy = float(found.energy)
    return stress, np.array(lost)


def same_in_two_steps(material: Material) -> CheckResult:
    """Check that a linear strain change gives the same stress in one step as in two."""
    once, twice = _walk(material, 1)[0], _walk(material, 2)[0]
    return CheckResult(
        name="same in two steps",
        requirement="a linear strain change gives the same stress in one step as in two",
        value=float(np.abs(once - twice).max()) / (_scale(material) * SMALL),
        bound=1e-10,
    )


def loses_energy(material: Material) -> CheckResult:
    """Check that the dissipation is never negative."""
    lost = _walk(material, 64)[1]
    return CheckResult(
        name="loses energy",
        requirement="the dissipation of relaxation is not negative for any strain history",
        value=max(0.0, -float(lost.min())) / (_scale(material) * SMALL**2),
        bound=0.0,
    )
