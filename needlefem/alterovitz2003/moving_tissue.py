"""Tissue in time on a mesh with moved nodes, and its operator ``A = A0 + S``.

Moved nodes change the operator in a few rows only; S is dense on their unknowns. The response of A
is computed with a low-rank correction of the factor of A0 (K. Woodbury 1950), or with a new factor.
`TissueInTime` and `MovingTissue` advance the tissue by Newmark's method with lumped mass.
"""

import dataclasses
from typing import Protocol

import numpy as np
from scipy.linalg.lapack import dgesv
from scipy.sparse import csc_array

from needlefem._arrays import Floats, Ints, Sparse, Vector
from needlefem.alterovitz2003.movable_mesh import MovableMesh, dense_places, spread
from needlefem.alterovitz2003.node_chain import Moves
from needlefem.dynamics import Damping, KinematicState, Newmark, TissueSystem
from needlefem.errors import CaseError
from needlefem.fem.compliance import CachedCompliance
from needlefem.fem.factorization import Factor, factorise
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.fem.tissue_model import TissueModel


class Equations:
    """Values of unknowns at nodes and loads on them; zero at fixed dofs."""

    def __init__(self, model: TissueModel) -> None:
        if model.frames is not None:
            problem = "an inclined support with the conforming coupling of the 2003 method"
            raise CaseError(
                "supports", problem, "fix components along the axes, or embed the needle"
            )
        number = np.full(model.ndofs, -1)
        number[model.free_dofs] = np.arange(len(model.free_dofs))
        self._table: Ints = number[model.node_dofs]
        self.size = len(model.free_dofs)

    def of(self, nodes: Ints) -> Ints:
        """Return the equations of nodes, ordered by node; -1 at fixed dofs."""
        found: Ints = self._table[nodes].ravel()
        return found

    def at(self, x: Floats, nodes: Ints) -> Floats:
        """Return unknowns, shape (..., size), at nodes, shape (..., 2 k)."""
        equations = self.of(nodes)
        found: Floats = np.where(equations >= 0, x[..., equations], 0.0)
        return found

    def add(self, target: Floats, nodes: Ints, loads: Floats) -> None:
        """Add loads, shape (2 k,), on nodes (each once) to a vector of unknowns."""
        equations = self.of(nodes)
        free = equations >= 0
        target[equations[free]] += loads[free]


class Corrected(Protocol):
    """Response of ``A0 + S`` at functionals, for one right-hand side at a time."""

    def correct(self, nodes: Ints, change: Floats) -> None:
        """Set another S, shape (2 k, 2 k), on given nodes."""
        ...

    def attach(self, nodes: Ints, loads: Floats) -> Floats:
        """Set functionals, shape (r, 2 k), of nodes; return their compliance, (r, r)."""
        ...

    def start(self, rhs: Floats) -> Floats:
        """Return the functionals' values for a right-hand side, shape (r,)."""
        ...

    def finish(self, forces: Floats) -> Floats:
        """Return all unknowns for this right-hand side and forces on the functionals."""
        ...


class LowRank:
    """A correction that uses one factor of A0; see `Corrected`.

    ``inv(A) = inv(A0) - inv(A0) T inv(A0)`` with ``T = inv(I + S C) S``, where C is the
    compliance of A0 between the changed unknowns.

    Parameters
    ----------
    model : TissueModel
    factor : Factor
        Factor of A0.
    responses : CachedCompliance
        Compliance of the same factor; shared by all insertions.
    """

    def __init__(self, model: TissueModel, factor: Factor, responses: CachedCompliance) -> None:
        self._equations, self._factor, self._responses = Equations(model), factor, responses
        self._changed: Ints = np.zeros(0, dtype=np.intp)
        self._t: Floats = np.zeros((0, 0))

    def correct(self, nodes: Ints, change: Floats) -> None:
        """See `Corrected`."""
        self._changed = nodes
        rows = self._responses.rows(nodes)
        compliance = self._responses.compliance[np.ix_(rows, rows)]
        found: Floats = np.linalg.solve(np.eye(len(rows)) + change @ compliance, change).astype(
            float, copy=False
        )
        self._t = 0.5 * (found + found.T)

    def attach(self, nodes: Ints, loads: Floats) -> Floats:
        """See `Corrected`."""
        self._nodes, self._loads = nodes, loads
        mine, changed = self._responses.rows(nodes), self._responses.rows(self._changed)
        compliance = self._responses.compliance
        self._cross = loads @ compliance[np.ix_(mine, changed)]
        bare = loads @ compliance[np.ix_(mine, mine)] @ loads.T
        corrected: Floats = bare - self._cross @ self._t @ self._cross.T
        return corrected

    def start(self, rhs: Floats) -> Floats:
        """See `Corrected`."""
        self._bare = self._factor.solve(rhs)
        self._pull = self._t @ self._equations.at(self._bare, self._changed)
        values: Floats = self._loads @ self._equations.at(self._bare, self._nodes)
        return values - self._cross @ self._pull

    def finish(self, forces: Floats) -> Floats:
        """See `Corrected`."""
        load = np.zeros(self._equations.size)
        self._equations.add(load, self._nodes, self._loads.T @ forces)
        pull = self._pull + self._t @ (self._cross.T @ forces)
        self._equations.add(load, self._changed, -pull)
        return self._bare + self._factor.solve(load)


class Refactored:
    """A new factor for each correction; see `Corrected`.

    Parameters
    ----------
    model : TissueModel
    matrix : sparse matrix
        A0 on the free dofs.
    """

    def __init__(self, model: TissueModel, matrix: Sparse) -> None:
        self._equations, self._matrix = Equations(model), csc_array(matrix)
        self._factor: Factor = factorise(self._matrix)

    def correct(self, nodes: Ints, change: Floats) -> None:
        """See `Corrected`."""
        equations = self._equations.of(nodes)
        free = np.flatnonzero(equations >= 0)
        rows, columns = np.repeat(equations[free], len(free)), np.tile(equations[free], len(free))
        entries = change[np.ix_(free, free)].ravel()
        shape = self._matrix.shape
        self._factor = factorise(self._matrix + csc_array((entries, (rows, columns)), shape=shape))

    def attach(self, nodes: Ints, loads: Floats) -> Floats:
        """See `Corrected`."""
        self._nodes, self._loads = nodes, loads
        columns = np.zeros((self._equations.size, len(loads)))
        for column, load in enumerate(loads):
            self._equations.add(columns[:, column], nodes, load)
        columns = self._factor.solve(columns)
        found: Floats = self._loads @ self._equations.at(columns.T, nodes).T
        return 0.5 * (found + found.T)

    def start(self, rhs: Floats) -> Floats:
        """See `Corrected`."""
        self._bare = self._factor.solve(rhs)
        values: Floats = self._loads @ self._equations.at(self._bare, self._nodes)
        return values

    def finish(self, forces: Floats) -> Floats:
        """See `Corrected`."""
        load = np.zeros(self._equations.size)
        self._equations.add(load, self._nodes, self._loads.T @ forces)
        return self._bare + self._factor.solve(load)


# Tissue that is advanced by Newmark's method with lumped mass, with nodes that can be moved.


class TissueInTime:
    """Data that all insertions in one tissue share.

    Parameters
    ----------
    model : TissueModel
        Model with P1 triangles.
    integrator : Newmark
    step : float, s
    damping : Damping
    refactor : bool
        Whether a new factor is computed for each new tip node, instead of a correction.

    Attributes
    ----------
    elastic, inertia : float
        The operator of a step is ``elastic K + inertia M``.
    """

    def __init__(
        self, model: TissueModel, integrator: Newmark, step: float, damping: Damping, *,
        refactor: bool = False,
    ) -> None:  # fmt: skip
        self.model, self.mesh, self.equations = model, MovableMesh(model), Equations(model)
        self.system = TissueSystem(model, damping, lumping="row-sum")
        self.stepper = integrator.stepper(self.system, step)
        beta, gamma = integrator.beta, integrator.gamma
        mass, drag = 1.0 / (beta * step**2), gamma / (beta * step)
        self.elastic = 1.0 + drag * damping.stiffness_time
        self.inertia = mass + drag * damping.mass_rate
        self.damping = damping
        predicted = np.array([1.0, step, step**2 * (0.5 - beta)])
        rates = drag * predicted - np.array([0.0, 1.0, step * (1.0 - gamma)])
        # coefficients of M and K on the right-hand side, for (u, v, a)
        self._known = np.array(
            [mass * predicted + damping.mass_rate * rates, damping.stiffness_time * rates]
        )
        self._mass: Floats = self.system.mass.diagonal()
        self._stiffness = model.free_block(model.stiffness.matrix.tocsr())
        self._refactor = refactor
        self._responses = CachedCompliance(model, self.stepper.factor)

    def corrected(self) -> Corrected:
        """Return the operator of a step for corrections."""
        if self._refactor:
            matrix = self.elastic * self._stiffness
            return Refactored(self.model, matrix + self.inertia * self.system.mass)
        return LowRank(self.model, self.stepper.factor, self._responses)

    def known(self, motion: KinematicState) -> Floats:
        """Return the vectors that M and K multiply on the right-hand side, shape (2, n)."""
        found: Floats = self._known @ np.array([motion.u, motion.v, motion.a])
        return found

    def rhs(self, known: Floats) -> Floats:
        """Return the right-hand side with all nodes at their original positions, shape (n,)."""
        found: Floats = self._mass * known[0] + self._stiffness @ known[1]
        return found


# Tissue in time on a mesh with moved nodes. Matrices change in the cells around moved nodes only.
# The nodes on the shaft change rarely and are a correction of the operator of the step. The cells
# around the tip node, which moves in each step, are a second small correction.


@dataclasses.dataclass(frozen=True, eq=False)
class Patch:
    """The cells around the tip node.

    Parameters
    ----------
    cells : array, shape (n,)
    corner : array, shape (n, 3)
        Number of the tip node among the corners of each cell.
    nodes : array, shape (k,)
    places : tuple
        See `needlefem.alterovitz2003.movable_mesh.dense_places`.
    stiffness, mass : arrays
        Their matrices in the operator.
    """

    cells: Ints
    corner: Ints
    nodes: Ints
    places: tuple[Ints, Ints, int]
    stiffness: Floats
    mass: Floats


class MovingTissue:
    """State of a tissue on its mesh with moved nodes.

    Parameters
    ----------
    shared : TissueInTime
        Its mesh must have all nodes at their original positions.
    frame : array, shape (2, 2)
        Frame of the needle.
    """

    def __init__(self, shared: TissueInTime, frame: Floats) -> None:
        self.shared, self.mesh, self.frame = shared, shared.mesh, frame
        for node in self.mesh.moved:
            self.mesh.restore(int(node))
        self.motion: KinematicState = shared.stepper.at_rest()
        self._corrected = shared.corrected()
        self._changed = self.mesh.change()

    def transfer(self, moves: Moves) -> None:
        """Give nodes that will be moved the motion of the material at their new positions."""
        motion, table = self.motion, self.shared.equations
        fields = np.array([motion.u, motion.v, motion.a])
        found = []
        for node, point in moves:
            ring = np.unique(self.mesh.cells[self.mesh.around(np.array([node]))])
            cell, share = self.mesh.find(point[None], self.mesh.around(ring))
            corners = self.mesh.cells[cell[0]]
            if cell[0] < 0:  # outside of the tissue: the material moves with the node
                corners, share = np.full(3, node), np.full((1, 3), 1.0 / 3.0)
            values = table.at(fields, corners).reshape(3, 3, 2)
            found.append(np.einsum("c,fcd->fd", share[0], values))
        for (node, _), value in zip(moves, found, strict=True):
            equations = table.of(np.array([node]))
            free = equations >= 0
            for vector, new in zip((motion.u, motion.v, motion.a), value, strict=True):
                vector[equations[free]] = new[free]

    def freeze(self, tip_node: int, shaft: LinearFunctionals, near: Ints) -> None:
        """Correct the operator for the present nodes, and set the functionals of the needle.

        Parameters
        ----------
        tip_node : int
        shaft : LinearFunctionals
            One functional per shaft node.
        near : array
            Further nodes that the tip functional may use.
        """
        shared = self.shared
        self._changed = nodes, stiffness, mass = self.mesh.change()
        change = shared.elastic * stiffness + np.diag(shared.inertia * mass)
        self._corrected.correct(nodes, change)
        self._patch = patch = self._patch_of(tip_node)
        self.near: Ints = np.concatenate([patch.nodes, np.setdiff1d(near, patch.nodes)])
        self._position = np.full(shared.model.nnodes, -1)
        self._position[self.near] = np.arange(len(self.near))
        count, size = len(shaft.rows), 2 * len(self.near)
        union = np.unique(np.concatenate([shaft.nodes, self.near]))
        loads = np.zeros((2 * count + size, 2 * len(union)))
        columns = 2 * np.searchsorted(union, shaft.nodes)
        for row, direction in zip((0, count), self.frame, strict=True):
            for axis in range(2):
                loads[row : row + count, columns + axis] = shaft.rows * direction[axis]
        places = 2 * np.searchsorted(union, self.near)
        loads[2 * count + np.arange(size), (places[:, None] + np.arange(2)).ravel()] = 1.0
        whole = self._corrected.attach(union, loads)
        self._rows = 2 * count
        self._pairs = whole[: self._rows, : self._rows]
        self._beside = whole[: self._rows, self._rows :]
        self._between = whole[self._rows :, self._rows :]

    def _patch_of(self, tip_node: int) -> Patch:
        cells = self.mesh.around(np.array([tip_node]))
        nodes, local = np.unique(self.mesh.cells[cells], return_inverse=True)
        corner = self.mesh.cells[cells] == tip_node
        places = dense_places(local.reshape(-1, 3))
        stiffness, mass = self.mesh.stiffness[cells].copy(), self.mesh.mass[cells].copy()
        return Patch(cells, corner, nodes, places, stiffness, mass)

    def begin(self) -> None:
        """Begin a step from the present motion."""
        shared, (nodes, stiffness, mass) = self.shared, self._changed
        known = shared.known(self.motion)
        rhs = shared.rhs(known)
        inertial, elastic = shared.equations.at(known, nodes)
        shared.equations.add(rhs, nodes, mass * inertial + stiffness @ elastic)
        self._free = self._corrected.start(rhs)
        self._patch_known = shared.equations.at(known, self._patch.nodes)

    def ratio(self, point: Vector) -> float:
        """Return the smallest relative area of the cells for a position of the tip node."""
        return float(self.mesh.ratios(self._patch.cells, self._corners(point)).min())

    def _corners(self, point: Vector) -> Floats:
        corners = self.mesh.corners(self._patch.cells)
        corners[self._patch.corner] = point
        return corners

    def respond(self, point: Vector, tip: LinearFunctionals) -> "Response":
        """Return the response of the needle's rows for a position of the tip node.

        Parameters
        ----------
        point : array, shape (2,), m
        tip : LinearFunctionals
            Functional of the tip (one row), over `near` nodes.
        """
        patch, rows = self._patch, self._rows
        stiffness, mass = self.mesh.matrices(patch.cells, self._corners(point))
        change, added = spread(patch.places, stiffness - patch.stiffness, mass - patch.mass)
        constant = added * self._patch_known[0] + change @ self._patch_known[1]
        size = len(change)
        change *= self.shared.elastic
        change.flat[:: size + 1] += self.shared.inertia * added
        at = (2 * self._position[tip.nodes][:, None] + np.arange(2)).ravel()
        loads = (tip.rows[0][None, :, None] * self.frame[:, None, :]).reshape(2, -1)
        crossed = self._beside[:, at] @ loads.T
        behind = loads @ self._between[at]
        compliance = np.empty((rows + 2, rows + 2))
        compliance[:rows, :rows] = self._pairs
        compliance[:rows, rows:], compliance[rows:, :rows] = crossed, crossed.T
        compliance[rows:, rows:] = behind[:, at] @ loads.T
        free = np.concatenate([self._free[:rows], loads @ self._free[rows:][at]])
        coupling = np.concatenate([self._beside[:, :size], behind[:, :size]])
        constant = constant - change @ self._free[rows : rows + size]
        matrix = change @ self._between[:size, :size]
        matrix.flat[:: size + 1] += 1.0
        *_, solved, _ = dgesv(matrix, np.column_stack([change, constant]))
        pull, push = 0.5 * (solved[:, :-1] + solved[:, :-1].T), solved[:, -1]
        compliance -= coupling @ pull @ coupling.T
        return Response(compliance, free + coupling @ push, coupling, pull, push, at, loads)

    def finish(self, response: "Response", forces: Floats) -> None:
        """Finish the step with given forces on the needle's rows."""
        on_rows = np.zeros(self._rows + 2 * len(self.near))
        on_rows[: self._rows] = forces[:-2]
        near = on_rows[self._rows :]
        near[response.at] += response.loads.T @ forces[-2:]
        near[: len(response.push)] += response.push - response.pull @ (response.coupling.T @ forces)
        moved = self._corrected.finish(on_rows)
        self.motion = self.shared.stepper.advance(self.motion, moved)

    def moved(self, weights: LinearFunctionals) -> Floats:
        """Return the displacement of functionals, shape (nrows, 2), m."""
        values = self.shared.equations.at(self.motion.u, weights.nodes).reshape(-1, 2)
        found: Floats = weights.rows @ values
        return found


@dataclasses.dataclass(frozen=True, eq=False)
class Response:
    """Response of the needle's rows for one position of the tip node.

    Parameters
    ----------
    compliance : array, shape (2 n + 2, 2 n + 2), m/N
        Rows: axial and lateral ones of n shaft nodes, axial and lateral one of the tip.
    free : array, shape (2 n + 2,), m
        Displacements without contact forces.
    coupling, pull, push, at, loads : arrays
        Data for `MovingTissue.finish`.
    """

    compliance: Floats
    free: Floats
    coupling: Floats
    pull: Floats
    push: Floats
    at: Ints
    loads: Floats
