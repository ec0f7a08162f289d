"""Tissue in time on a mesh whose nodes are moved along by the needle.

Matrices change in the cells around moved nodes only: what stays for a while (nodes on the shaft)
is a correction of the step's operator, the cells around the node at the tip, which moves in every
step, are a small one on top.
"""

import dataclasses

import numpy as np
from scipy.linalg.lapack import dgesv

from needlefem._arrays import Floats, Ints, Vector
from needlefem.alterovitz2003.movable_mesh import dense_places, spread
from needlefem.alterovitz2003.node_chain import Moves
from needlefem.alterovitz2003.tissue_in_time import TissueInTime
from needlefem.dynamics import KinematicState
from needlefem.fem.interpolation import LinearFunctionals


@dataclasses.dataclass(frozen=True, eq=False)
class Patch:
    """The cells around the node at the tip.

    Parameters
    ----------
    cells : array, shape (n,)
    corner : array, shape (n, 3)
        Which of their corners is the node.
    nodes : array, shape (k,)
    places : tuple
        See `needlefem.alterovitz2003.movable_mesh.dense_places`.
    stiffness, mass : arrays
        Their matrices as the operator has them.
    """

    cells: Ints
    corner: Ints
    nodes: Ints
    places: tuple[Ints, Ints, int]
    stiffness: Floats
    mass: Floats


class MovingTissue:
    """A tissue at one time, on its moved mesh.

    Parameters
    ----------
    shared : TissueInTime
        Its mesh is taken into use with all nodes at home.
    frame : array, shape (2, 2)
        The needle's.
    """

    def __init__(self, shared: TissueInTime, frame: Floats) -> None:
        self.shared, self.mesh, self.frame = shared, shared.mesh, frame
        for node in self.mesh.moved:
            self.mesh.restore(int(node))
        self.motion: KinematicState = shared.stepper.at_rest()
        self._corrected = shared.corrected()
        self._changed = self.mesh.change()

    def transfer(self, moves: Moves) -> None:
        """Give nodes that are about to move the motion of the material where they will be."""
        motion, table = self.motion, self.shared.equations
        fields = np.array([motion.u, motion.v, motion.a])
        found = []
        for node, point in moves:
            ring = np.unique(self.mesh.cells[self.mesh.around(np.array([node]))])
            cell, share = self.mesh.find(point[None], self.mesh.around(ring))
            corners = self.mesh.cells[cell[0]]
            if cell[0] < 0:  # beyond: the material moves with the node
                corners, share = np.full(3, node), np.full((1, 3), 1.0 / 3.0)
            values = table.at(fields, corners).reshape(3, 3, 2)
            found.append(np.einsum("c,fcd->fd", share[0], values))
        for (node, _), value in zip(moves, found, strict=True):
            equations = table.of(np.array([node]))
            free = equations >= 0
            for vector, new in zip((motion.u, motion.v, motion.a), value, strict=True):
                vector[equations[free]] = new[free]

    def freeze(self, tip_node: int, shaft: LinearFunctionals, near: Ints) -> None:
        """Correct the operator for all nodes as they are, and look at the needle's rows.

        Parameters
        ----------
        tip_node : int
        shaft : LinearFunctionals
            One functional for every node on the shaft.
        near : array
            Further nodes that the tip's functional may weigh.
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
        """Return the least area around the tip's node at a point, relative to that at home."""
        return float(self.mesh.ratios(self._patch.cells, self._corners(point)).min())

    def _corners(self, point: Vector) -> Floats:
        corners = self.mesh.corners(self._patch.cells)
        corners[self._patch.corner] = point
        return corners

    def respond(self, point: Vector, tip: LinearFunctionals) -> "Response":
        """Return the response of the needle's rows with the tip's node at a point.

        Parameters
        ----------
        point : array, shape (2,), m
        tip : LinearFunctionals
            The tip's functional (one row), over `near` nodes.
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
        """End the step under forces on the needle's rows."""
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
    """The needle's rows with the tip's node at one place.

    Parameters
    ----------
    compliance : array, shape (2 n + 2, 2 n + 2), m/N
        Rows: axial and lateral ones of n shaft nodes, axial and lateral one of the tip.
    free : array, shape (2 n + 2,), m
        Displacements without contact forces.
    coupling, pull, push, at, loads : arrays
        What `MovingTissue.finish` needs to know.
    """

    compliance: Floats
    free: Floats
    coupling: Floats
    pull: Floats
    push: Floats
    at: Ints
    loads: Floats
