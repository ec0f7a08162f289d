"""Displacements on a refined mesh by conjugate gradients, preconditioned by a coarser mesh.

The preconditioner adds the factor of the coarser tissue and the inverse diagonal of the finer
stiffness. The factor reduces the smooth part of the residual, the diagonal its oscillating part.
The condition number of the preconditioned system does not grow with the number of elements (J. Xu,
SIAM Review 34, 1992). Some tens of iterations replace the factorisation of the finer tissue, which
would cost several times that of the coarser one.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, cg

from needlefem._arrays import Floats, Sparse
from needlefem.fem.tissue_model import TissueModel

LEFT = 1e-2
"""Residual at the end, relative to the residual of the coarser solution."""
MOST_ITERATIONS = 200


class TwoLevelSolver:
    """A two-level solver for a finer and a coarser tissue with the same laws and supports.

    Parameters
    ----------
    finer, coarser : TissueModel
        Tissues whose elements have no pressure field.
    """

    def __init__(self, finer: TissueModel, coarser: TissueModel) -> None:
        self._finer, self._coarser = finer, coarser
        self._diagonal = finer.stiffness.matrix.diagonal()
        self._spread = _spread(finer, coarser)
        self._gather = self._spread.T.tocsr()

    def solve(self, load: Floats) -> Floats:
        """Return displacements for a load on all dofs, both of shape (ndofs,)."""
        load = self._unheld(load.copy())
        found = self._coarse(load)
        size = (len(load), len(load))
        change, failed = cg(
            LinearOperator(size, matvec=self._force, dtype=float),
            load - self._force(found),
            rtol=LEFT,
            maxiter=MOST_ITERATIONS,
            M=LinearOperator(size, matvec=self._smoothed, dtype=float),
        )
        return self._finer.solve(load) if failed else found + change

    def _unheld(self, field: Floats) -> Floats:
        frames = self._finer.frames
        if frames is not None:
            field = frames.matrix.T @ field
        field[self._finer.held_dofs] = 0.0
        return field if frames is None else frames.matrix @ field

    def _force(self, moved: Floats) -> Floats:
        return self._unheld(self._finer.stiffness.matrix @ moved)

    def _smoothed(self, rest: Floats) -> Floats:
        smoothed: Floats = self._unheld(rest / self._diagonal) + self._coarse(rest)
        return smoothed

    def _coarse(self, load: Floats) -> Floats:
        """Return the coarser tissue's displacement for a load, both on the finer dofs."""
        found: Floats = self._spread @ self._coarser.factor.solve(self._gather @ load)
        return found


def _spread(finer: TissueModel, coarser: TissueModel) -> Sparse:
    """Return the interpolation from the coarser free dofs to the finer dofs, 0 in fixed ones."""
    cells, reference = coarser.interpolation.locator.find(finer.nodes)
    inside = np.flatnonzero(cells >= 0)
    there = coarser.node_dofs[coarser.interpolation.nodes_of(cells[inside])]
    here = np.broadcast_to(finer.node_dofs[inside][:, None], there.shape)
    values = np.broadcast_to(
        coarser.interpolation.shape(reference[inside])[:, :, None], there.shape
    )
    entries = (values.ravel(), (here.ravel(), there.ravel()))
    spread: Sparse = sparse.csr_array(entries, shape=(finer.ndofs, coarser.ndofs))
    if coarser.frames is not None:
        spread = spread @ coarser.frames.matrix
    spread = spread[:, coarser.free_dofs]
    free = np.ones(finer.ndofs)
    free[finer.held_dofs] = 0.0
    projection: Sparse = sparse.diags_array(free)
    if finer.frames is not None:
        projection = finer.frames.matrix @ projection @ finer.frames.matrix.T
    spread = (projection @ spread).tocsr()
    spread.eliminate_zeros()
    return spread
