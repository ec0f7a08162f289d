"""The stiffness of several materials at once is the sum of what each of them adds."""

from itertools import product

import numpy as np
import pytest
from skfem import Basis, ElementVector

from needlefem.checks import square_mesh
from needlefem.elements import CATALOGUE
from needlefem.fem.forms import stiffness


def law(angle: float, along: float) -> np.ndarray:
    """Return a law with stiff fibres at an angle, in Voigt's notation, shape (3, 3)."""
    plain = np.array([[4.0, 1.5, 0.0], [1.5, 4.0, 0.0], [0.0, 0.0, 1.2]])
    c, s = np.cos(angle), np.sin(angle)
    fibre = np.array([c * c, s * s, c * s])
    return plain + along * np.outer(fibre, fibre)


LAWS = {
    "isotropic": law(0.0, 0.0),
    "fibres along an axis": law(0.0, 5.0),
    "fibres along the other": law(0.5 * np.pi, 5.0).round(12),
    "turned fibres": law(0.6, 5.0),
    "fibres turned back": law(-0.6, 3.0),
    "no coupling": np.diag([3.0, 2.0, 1.0]),
}


@pytest.mark.parametrize("name", ["P1", "P2", "Q1", "Q2"])
@pytest.mark.parametrize(("one", "other"), list(product(LAWS, LAWS)))
def test_two_regions_add_up(name: str, one: str, other: str) -> None:
    element = CATALOGUE[name]
    mesh = square_mesh(element, 3)
    count = mesh.t.shape[1]
    first = np.arange(count) < count // 2
    kind, rule = ElementVector(element.skfem_element()), element.stiffness_rule()
    both = np.where(first, LAWS[one][:, :, None], LAWS[other][:, :, None])
    found = stiffness(Basis(mesh, kind, quadrature=rule), both).toarray()
    wanted = np.zeros_like(found)
    for cells, name_of in ((np.flatnonzero(first), one), (np.flatnonzero(~first), other)):
        part = Basis(mesh, kind, quadrature=rule, elements=cells)
        gradients = [part.basis[i][0].grad for i in range(part.Nbfun)]
        strains = [np.array([g[0, 0], g[1, 1], g[0, 1] + g[1, 0]]) for g in gradients]
        for i, j in product(range(part.Nbfun), repeat=2):
            work = np.einsum("aep,ab,bep->ep", strains[i], LAWS[name_of], strains[j])
            values = np.sum(work * part.dx, axis=1)
            np.add.at(wanted, (part.element_dofs[i], part.element_dofs[j]), values)
    assert found == pytest.approx(wanted, abs=1e-12 * np.abs(wanted).max())
