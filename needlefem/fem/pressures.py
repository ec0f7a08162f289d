"""The pressure of a mixed element: continuous in a material, with a jump between two.

Where two laws meet the strain jumps, and with it the pressure: functions continuous across the
interface would smear it.
"""

from typing import Any

import numpy as np
from scipy.sparse import block_array, vstack

from needlefem._arrays import Floats, Ints, Points, SkfemMesh, Sparse
from needlefem.elements import ElementType
from needlefem.elements.shape_functions import shape_table
from needlefem.fem import forms


class Pressures:
    """Pressures of a mixed element, numbered material by material.

    Parameters
    ----------
    mesh : skfem.Mesh
    element : ElementType
        A mixed one.
    owner : array, shape (ncells,)
        The law of every cell.
    """

    def __init__(self, mesh: SkfemMesh, element: ElementType, owner: Ints) -> None:
        self._element = element
        self._basis = forms.pressure_basis(mesh, element)
        self._parts = [np.flatnonzero(owner == number) for number in range(int(owner.max()) + 1)]
        self._parts = [cells for cells in self._parts if cells.size]
        self._used = [np.unique(self._basis.element_dofs[:, cells]) for cells in self._parts]
        starts = np.cumsum([0, *(len(used) for used in self._used)])
        self.count = int(starts[-1])
        self.cell_dofs: Ints = np.empty_like(self._basis.element_dofs, dtype=np.intp)
        for cells, used, start in zip(self._parts, self._used, starts[:-1], strict=True):
            local = np.searchsorted(used, self._basis.element_dofs[:, cells])
            self.cell_dofs[:, cells] = start + local

    def coupling(self, basis: Any) -> Sparse:
        """Return B, shape (count, ndofs), on the displacement's basis."""
        rows = []
        for cells, used in zip(self._parts, self._used, strict=True):
            whole = forms.coupling(basis.with_elements(cells), self._basis.with_elements(cells))
            rows.append(whole.tocsr()[used])
        return vstack(rows).tocsr()

    def mass(self, weight: Floats) -> Sparse:
        """Return the mass matrix weighted by one number a cell, shape (count, count)."""
        blocks = []
        for cells, used in zip(self._parts, self._used, strict=True):
            whole = forms.pressure_mass(self._basis.with_elements(cells), weight[cells])
            blocks.append(whole.tocsr()[used][:, used])
        n = len(blocks)
        diagonal = [[blocks[i] if i == j else None for j in range(n)] for i in range(n)]
        return block_array(diagonal).tocsr()

    def at(self, dofs: Floats, reference: Points) -> Floats:
        """Return pressures at reference points (n, dim) of every cell, shape (ncells, n)."""
        if self._element.pressure is None:  # `pressure_basis` has refused it already
            raise TypeError
        shape = shape_table(self._element.pressure)(reference)
        found: Floats = np.einsum("kc,nk->cn", dofs[self.cell_dofs], shape)
        return found
