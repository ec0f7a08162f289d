"""All checks of an element with a law."""

from collections.abc import Sequence

import numpy as np

from needlefem.checks import convergence, element_checks
from needlefem.checks.material_checks import check_law
from needlefem.checks.mesh_checks import NEARLY_INCOMPRESSIBLE
from needlefem.checks.result import CheckResult, outcome
from needlefem.elements import ElementType
from needlefem.materials import Isotropic, Material, plane_volumetric_split


def check_element_material(
    element: ElementType, material: Material, plane: str = "strain"
) -> tuple[CheckResult, ...]:
    """Return the results of all checks of an element and a law in the plane.

    Parameters
    ----------
    element : ElementType
        On triangles or quadrilaterals.
    material : Material
    plane : str
        Plane 'strain' or 'stress'.

    Returns
    -------
    The checks of the law, of the element, and of both together. If the law or the element fails its
    own checks, the others are omitted, because they would fail for the same reason.
    """
    own = (*check_law(material), *element_checks.check_shape(element))
    if not all(check.passed for check in own):
        return own
    return (*own, *_together(element, material, plane))


def _together(element: ElementType, material: Material, plane: str) -> list[CheckResult]:
    law = plane_volumetric_split(material, plane)
    if element.definite and law.compressibility == 0.0:
        return [outcome("incompressibility", "an incompressible law needs a mixed element", 1.0, 0)]
    mild = material
    if law.compressibility == 0.0:  # checks with volume changes need a compressible law
        mild = Isotropic(youngs_modulus=1e4, poissons_ratio=NEARLY_INCOMPRESSIBLE)
    found = [
        *element_checks.patches(element, mild, plane, plane_volumetric_split(mild, plane)),
        *element_checks.modes(element, mild, plane),
        *convergence.convergence(element, material, plane, law),
        convergence.no_locking(element),
        *element_checks.masses(element, material, plane),
        element_checks.bad_cells_refused(element),
    ]
    if not element.definite:
        found.append(element_checks.pressure_stability(element))
    aligned = bool(np.all(np.abs(law.shape[:2, 2]) < 1e-12 * np.abs(law.shape).max()))
    if aligned and law.compressibility > 0.0:
        found.append(element_checks.frequencies(element, material, plane))
    return found


def failures(checks: Sequence[CheckResult]) -> list[str]:
    """Return the names of the checks that failed."""
    return [check.name for check in checks if not check.passed]
