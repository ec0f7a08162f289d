"""Contact between needle and tissue in terms of the tissue's compliance.

The contact uses linear functionals of the displacement only: the mean over the tip kernel and the
means over the contact segments of the cut path. The tissue is described by the compliance between
these functionals, ``W = B A^-1 B^T``, a small dense matrix. `CondensedContact` stores the contact
segments and eliminates their lateral forces with a Cholesky factor. The factor is extended by a
few rows for each new segment. `ShaftEquations` are the remaining equations in the axial direction.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dtrtrs

from needlefem._arrays import Floats, Ints, enlarged
from needlefem.fem.compliance import ComplianceColumns, ComplianceOperator
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.needle.needle_interface import NeedleInterface


class ContactSegment(NamedTuple):
    """A linear functional of the displacement: the mean over one segment of the cut path.

    Parameters
    ----------
    nodes : array, shape (k,)
    weights : array, shape (k,)
        The functional is ``sum_k weights[k] u[nodes[k]]``.
    offset : array, shape (dim - 1,), m
        Lateral offset of the segment's material from the needle axis before the deformation.
    compliance : float, m/N
        Compliance of the segment's lateral penalty.
    """

    nodes: Ints
    weights: Floats
    offset: Floats
    compliance: float


class ContactTrial(NamedTuple):
    """Functionals that are not part of the path yet, and the tissue's response to loads on them.

    The rows are ordered by functional: its axial component first, then its lateral components.

    Parameters
    ----------
    weights : LinearFunctionals
        The functionals.
    loads : array, shape (rows, n)
        Loads on the dofs of `rows` for unit forces on the functionals.
    rows : array, shape (n,)
        Rows of these dofs in the compliance operator.
    response : ComplianceColumns
        Displacement for these loads.
    bare : array, shape (rows, rows), m/N
        Compliance of the functionals if the lateral forces on the path do not change.
    coupling : array, shape (rows, path rows), m/N
        Displacement of the functionals for unit forces on the contact segments.
    half : array, shape (path laterals, rows)
        ``L^-1`` times the transposed lateral part of the coupling.
    compliance : array, shape (rows, rows), m/N
        Compliance of the functionals if the lateral forces on the path follow from the penalty.
    displacement : array, shape (rows,), m
        Displacement of the functionals without forces on them.
    """

    weights: LinearFunctionals
    loads: Floats
    rows: Ints
    response: ComplianceColumns
    bare: Floats
    coupling: Floats
    half: Floats
    compliance: Floats
    displacement: Floats


class AxialCompliance(NamedTuple):
    """Axial displacement of the active segments after elimination of the lateral forces.

    Parameters
    ----------
    compliance : array, shape (active, active), m/N
        Axial displacement for unit axial forces.
    displacement : array, shape (active,), m
        Axial displacement without axial forces.
    half : array, shape (active laterals, active)
        ``L^-1`` times the compliance between lateral and axial components.
    lateral_gap : array, shape (active laterals,)
        ``L^-1`` times the lateral gap that the penalty closes in the absence of axial forces.
    """

    compliance: Floats
    displacement: Floats
    half: Floats
    lateral_gap: Floats


class CondensedContact:
    """The contact segments of the cut path and their compliance.

    The number of segments grows as the needle advances. During a retraction only the first
    `active_segments` are active. Their data are the leading parts of all arrays that are stored
    here.

    Parameters
    ----------
    responses : ComplianceOperator
        Compliance of the operator of the time step.
    frame : array, shape (dim, dim)
        Rows: needle direction, lateral directions.
    free_displacement : array, shape (nnodes, dim), m, optional
        Displacement of the tissue in this step without needle forces.

    Attributes
    ----------
    inertial_drift : array, shape (3, nsegments), or None
        For tissue with inertia, three axial values of each segment: half of the displacement in
        this step at the velocity at its start (m), half of the displacement at the mean velocity
        of the previous step (m), and the compliance that results from inertia alone (m/N).
    """

    def __init__(
        self, responses: ComplianceOperator, frame: Floats, free_displacement: Floats | None = None
    ) -> None:
        self.responses, self.frame = responses, frame
        self.dim = len(frame)
        self.segments: list[ContactSegment] = []
        self.active_segments = 0
        self.friction_forces: Floats = np.zeros(0)
        self.free_displacement = free_displacement
        self.inertial_drift: Floats | None = None
        self._loads: list[tuple[Ints, Floats]] = []
        self._offsets: Floats = np.zeros(0)
        self._columns = np.zeros((0, 0))
        self._known_rows = 0
        self._w = np.zeros((0, 0))
        self._cholesky = np.zeros((0, 0))
        self._reduced: Floats = np.zeros(0)
        self._factor: Floats = np.zeros((0, 0))
        self._cached_rows: Ints | None = None
        self._cached_columns: Floats = np.zeros((0, 0))

    @property
    def _laterals(self) -> Ints | slice:
        """Path rows of the lateral components of the active segments."""
        if self.dim == 2:
            return slice(1, self._size, 2)
        return np.arange(self._size).reshape(-1, self.dim)[:, 1:].ravel()

    def _columns_at(self, rows: Ints) -> Floats:
        """Return the columns of the active segments; cached, because the same rows often recur."""
        if self._cached_rows is not rows or self._cached_columns.shape[1] != self._size:
            self._cached_rows, self._cached_columns = rows, self._columns[rows, : self._size]
        return self._cached_columns

    def trial(self, weights: LinearFunctionals) -> ContactTrial:
        """Return the tissue's response at functionals for the present path."""
        rows = self.responses.rows(weights.nodes)
        self._follow_growth()
        count = len(weights.rows) * self.dim
        loads = (weights.rows[:, None, :, None] * self.frame[:, None, :]).reshape(count, -1)
        if self.responses.frames is not None:
            loads = self.responses.frames.local_loads(weights.nodes, loads)
        response = self.responses.respond(rows, loads)
        bare = loads @ response.at(rows)
        coupling = loads @ self._columns_at(rows)
        displacement = coupling[:, :: self.dim] @ self.friction_forces[: self.active_segments]
        if self.free_displacement is not None:
            displacement += (weights.of(self.free_displacement) @ self.frame.T).ravel()
        half = self._forward(coupling[:, self._laterals].T)
        compliance = bare - half.T @ half
        displacement = displacement + half.T @ self._reduced
        return ContactTrial(
            weights, loads, rows, response, bare, coupling, half, compliance, displacement
        )

    def _forward(self, rhs: Floats) -> Floats:
        """Return ``L^-1 rhs`` with the Cholesky factor L of the active segments."""
        if not self.active_segments:
            return rhs
        solved, _ = dtrtrs(self._factor, rhs, lower=1)
        found: Floats = solved
        return found

    def _follow_growth(self) -> None:
        """Extend the segments' columns by the nodes that were added to the operator."""
        size = self.responses.size
        if size > self._known_rows:
            self._columns = enlarged(self._columns, size, 0)
            for number, (rows, loads) in enumerate(self._loads):
                columns = slice(number * self.dim, (number + 1) * self.dim)
                new = self.responses.respond(rows, loads).after(self._known_rows)
                self._columns[self._known_rows : size, columns] = new
            self._known_rows = size

    def field_at(
        self, nodes: Ints, path: Floats, trial: ContactTrial | None, forces: Floats
    ) -> Floats:
        """Return the displacement of nodes for given forces, shape (len(nodes), dim), m.

        Parameters
        ----------
        nodes : array, shape (k,)
        path : array, shape (n,)
            Forces on the first segments in the needle's frame, ordered by segment, N (N/m in 2D).
        trial : ContactTrial, optional
            Further functionals with forces.
        forces : array, shape (rows,)
            Forces on the functionals of `trial`, N (N/m in 2D).
        """
        rows = self.responses.rows(nodes)
        self._follow_growth()
        moved: Floats = self._columns[rows, : len(path)] @ path
        if trial is not None:
            moved = moved + trial.response.at(rows) @ forces
        field: Floats = moved.reshape(-1, self.dim)
        if self.responses.frames is None:
            return field
        return self.responses.frames.along_axes(nodes, field)

    def append_segment(
        self, trial: ContactTrial, which: int, axial: float, offset: Floats, compliance: float
    ) -> None:
        """Append a functional of a trial to the path as a segment; all segments become active.

        Parameters
        ----------
        trial : ContactTrial
            Trial that was computed for the present path.
        which : int
            Number of the functional in the trial.
        axial : float, N (N/m in 2D)
            Friction force on the segment.
        offset : array, shape (dim - 1,), m
            Lateral offset of the segment's material from the axis before the deformation.
        compliance : float, m/N
            Compliance of its lateral penalty.
        """
        dim, number = self.dim, len(self.segments)
        mine = slice(which * dim, (which + 1) * dim)
        lateral = slice(which * dim + 1, (which + 1) * dim)
        size, laterals = (number + 1) * dim, (number + 1) * (dim - 1)
        self._columns = enlarged(self._columns, self._known_rows, size)
        columns = trial.response.after(0, mine)[: self._known_rows]
        self._columns[: self._known_rows, size - dim : size] = columns
        self._loads.append((trial.rows, trial.loads[mine]))
        self._w = enlarged(self._w, size, size)
        self._w[size - dim : size, : size - dim] = trial.coupling[mine]
        self._w[: size - dim, size - dim : size] = trial.coupling[mine].T
        self._w[size - dim : size, size - dim : size] = trial.bare[mine, mine]
        self._cholesky = enlarged(self._cholesky, laterals, laterals)
        block = trial.compliance[lateral, lateral].copy()
        block.flat[::dim] += compliance  # the diagonal
        rows = slice(laterals - dim + 1, laterals)
        self._cholesky[rows, : rows.start] = trial.half[:, lateral].T
        self._cholesky[rows, rows] = np.sqrt(block) if dim == 2 else np.linalg.cholesky(block)
        row = trial.weights.rows[which]
        used = np.flatnonzero(row)
        self.segments.append(
            ContactSegment(trial.weights.nodes[used], row[used], offset, compliance)
        )
        self._offsets = np.concatenate([self._offsets, offset])
        self.friction_forces = np.concatenate([self.friction_forces, [axial]])
        self.active_segments = number + 1
        self.eliminate_lateral()

    def set_active(self, count: int) -> None:
        """Make the first `count` segments the active ones and update the elimination."""
        self.active_segments = count
        self.eliminate_lateral()

    def set_friction(self, axial: Floats) -> None:
        """Set the friction forces (N, N/m in 2D) of the first segments; these become active."""
        self.friction_forces = np.zeros(len(self.segments))
        self.friction_forces[: len(axial)] = axial
        self.set_active(len(axial))

    # Kernel: elimination of the lateral forces of the active segments.
    #     (W_nn + D) lambda = -(g + W_ne q + W_nt f),    D = diag(1 / (kappa w))
    # W       compliance between functionals, B A^-1 B^T, m/N (m^2/N in 2D)
    # n, e, t lateral and axial on the segments, tip
    # lambda  lateral force on each segment, N (N/m in 2D)
    # g       lateral offset of the segments from the axis without any force, m
    # q, f    friction forces on the segments; forces on the tip and its segment, N (N/m in 2D)
    # kappa w stiffness of the lateral penalty of a segment of length w, N/m (Pa in 2D)
    # Source: penalty constraint and static condensation; docs/theory.md, equation (8).
    def eliminate_lateral(self) -> None:
        """Eliminate the lateral forces for the present friction forces and free displacement."""
        self._reduced = np.zeros(0)
        if self.active_segments:
            size, laterals = self.active_segments * (self.dim - 1), self._laterals
            if len(self._factor) != size:  # in Fortran order, so that LAPACK does not copy it
                self._factor = np.asfortranarray(self._cholesky[:size, :size])
            free = (
                self._w[laterals, : self._size : self.dim]
                @ self.friction_forces[: self.active_segments]
            )
            self._reduced = self._forward(-(self._gap() + free))

    def _gap(self) -> Floats:
        """Lateral offset of the active segments from the axis without any force on them, m."""
        gap = self._offsets[: self.active_segments * (self.dim - 1)]
        if self.free_displacement is None:
            return gap
        found: Floats = gap + self._free_means()[self._laterals]
        return found

    def sliding(self) -> AxialCompliance:
        """Return the axial compliance of the active segments, before friction is considered."""
        axials = np.arange(0, self._size, self.dim)
        half, lateral_gap = np.zeros((0, len(axials))), np.zeros(0)
        if self.active_segments:
            half = self._forward(self._w[self._laterals][:, axials])
            lateral_gap = self._forward(-self._gap())
        compliance = self._w[np.ix_(axials, axials)] - half.T @ half
        displacement = self._free_means()[axials] + half.T @ lateral_gap
        return AxialCompliance(compliance, displacement, half, lateral_gap)

    @property
    def _size(self) -> int:
        return self.active_segments * self.dim

    def _free_means(self) -> Floats:
        """Displacement of the active segments without needle forces, shape (path rows,), m."""
        if self.free_displacement is None:
            return np.zeros(self._size)
        field = self.free_displacement
        active = self.segments[: self.active_segments]
        means = np.array([segment.weights @ field[segment.nodes] for segment in active])
        rows: Floats = (means @ self.frame.T).ravel()
        return rows

    def lateral_forces(self, trial: ContactTrial, forces: Floats) -> Floats:
        """Return lateral forces on the active segments, shape (active, dim - 1), N (N/m in 2D).

        Parameters
        ----------
        trial : ContactTrial
            Trial that was computed for the present path.
        forces : array, shape (rows,)
            Forces on the functionals of the trial.
        """
        if not self.active_segments:
            return np.zeros((0, self.dim - 1))
        rhs = self._reduced - trial.half @ forces
        solved, _ = dtrtrs(self._factor, rhs, lower=1, trans=1)
        return np.asarray(solved).reshape(-1, self.dim - 1)

    def displacements(self, laterals: Floats, trial: ContactTrial, forces: Floats) -> Floats:
        """Return the mean displacements of the segments, followed by those of the trial.

        Parameters
        ----------
        laterals : array, shape (active, dim - 1)
            Lateral forces on the segments, as returned by `lateral_forces`.
        trial : ContactTrial
            Trial that was computed for the present path.
        forces : array, shape (rows,)
            Forces on the functionals of the trial.

        Returns
        -------
        array, shape (active + functionals, dim), m
            In the needle's frame: axial, then lateral components.
        """
        path = np.hstack([self.friction_forces[: self.active_segments, None], laterals]).ravel()
        w = self._w[: self._size, : self._size]
        segments = w @ path + trial.coupling.T @ forces + self._free_means()
        tried = trial.coupling @ path + trial.bare @ forces
        if self.free_displacement is not None:
            tried += (trial.weights.of(self.free_displacement) @ self.frame.T).ravel()
        return np.concatenate([segments, tried]).reshape(-1, self.dim)


# Axial equations of one step. The unknowns are the friction forces on the active segments, the
# friction force on the tip's segment and the axial force on the tip. The lateral forces are
# eliminated. If each friction force lies within its limits and the tip force lies between zero and
# the cutting force, the forces minimise a convex potential under bounds. The gradient of the
# potential is the slip between needle and tissue.


# Kernel: axial equations of shaft and tip with all lateral forces eliminated.
#     u_e = u_0 + S z
# u_e     axial displacement of the segments and of the tip's kernel, m
# u_0     the same without axial forces, m
# S       W_ee - W_en (W_nn + D)^-1 W_ne, m/N (m^2/N in 2D)
# z       axial forces on the segments and on the tip, N (N/m in 2D)
# Source: static condensation, R. J. Guyan, AIAA Journal 3 (1965) 380; docs/theory.md, (8), (10).
@dataclasses.dataclass(frozen=True, eq=False)
class ShaftEquations:
    """Axial displacements as affine functions of the axial forces, ``u = free + compliance z``.

    The rows and the forces `z` are ordered: active segments, tip's segment, tip. The first
    functional of the trial is the tip kernel, the second is the tip's segment.

    Parameters
    ----------
    trial : ContactTrial
    sliding : AxialCompliance
        Axial compliance of the active segments.
    compliance : array, shape (n, n), m/N
    free : array, shape (n,), m
    lateral_force_map : array, shape (dim - 1, n + 1), N/N and N
        Lateral force on the tip's segment: coefficients of the axial forces, then the constant.
    lateral_displacement_map : array, shape (dim - 1, n + 1), m/N and m
        Lateral displacement of the tip kernel: coefficients of the axial forces, then the constant.
    """

    trial: ContactTrial
    sliding: AxialCompliance
    compliance: Floats
    free: Floats
    lateral_force_map: Floats
    lateral_displacement_map: Floats

    @classmethod
    def build(
        cls,
        contact: CondensedContact,
        sliding: AxialCompliance,
        trial: ContactTrial,
        offset: Floats,
        stiffness: float,
    ) -> "ShaftEquations":
        """Return the axial equations after elimination of all lateral forces.

        Parameters
        ----------
        contact : CondensedContact
        sliding : AxialCompliance
            Result of `contact.sliding()` for the present path.
        trial : ContactTrial
            Trial that was computed for the present path.
        offset : array, shape (dim - 1,), m
            Lateral offset of the tip's segment from the axis before the deformation.
        stiffness : float, N/m
            Stiffness of its lateral penalty.
        """
        dim, count = contact.dim, contact.active_segments
        cross = trial.coupling[:, ::dim] - trial.half.T @ sliding.half
        bare = trial.half.T @ sliding.lateral_gap
        if contact.free_displacement is not None:
            bare = bare + (trial.weights.of(contact.free_displacement) @ contact.frame.T).ravel()
        axial, end = [dim, 0], slice(dim + 1, 2 * dim)
        columns = np.hstack([cross, trial.compliance[:, axial]])  # for the rows of the trial
        compliance = np.zeros((count + 2, count + 2))
        compliance[:count, :count] = sliding.compliance
        compliance[:count, count:] = cross[axial].T
        compliance[count:] = columns[axial]
        free = np.concatenate([sliding.displacement, bare[axial]])
        # lateral force on the tip's segment, and its effect on all other rows
        spring = np.eye(dim - 1) + stiffness * trial.compliance[end, end]
        rhs = np.column_stack([columns[end], offset + bare[end]])
        force_map: Floats = -stiffness * np.linalg.solve(spring, rhs).astype(float)
        back = columns[end].T
        displacement_map = np.column_stack([columns[1:dim], bare[1:dim]])
        displacement_map += trial.compliance[1:dim, end] @ force_map
        compliance += back @ force_map[:, :-1]
        free = free + back @ force_map[:, -1]
        compliance = 0.5 * (compliance + compliance.T)
        return cls(trial, sliding, compliance, free, force_map, displacement_map)

    def lateral(self, forces: Floats) -> Floats:
        """Return the lateral force on the tip's segment, shape (dim - 1,), N (N/m in 2D)."""
        return _affine(self.lateral_force_map, forces)

    def lateral_tip_displacement(self, forces: Floats) -> Floats:
        """Return the lateral displacement of the tip kernel, shape (dim - 1,), m."""
        return _affine(self.lateral_displacement_map, forces)


def _affine(part: Floats, forces: Floats) -> Floats:
    found: Floats = part[:, :-1] @ forces + part[:, -1]
    return found


def straight_contact(
    instrument: NeedleInterface, responses: ComplianceOperator, count: int
) -> CondensedContact:
    """Return a contact with equal segments along the insertion axis, without forces.

    Parameters
    ----------
    instrument : NeedleInterface
    responses : ComplianceOperator
        Compliance of the tissue.
    count : int
        Number of segments, from the entry.
    """
    axis, spacing = instrument.axis, instrument.spacing
    contact = CondensedContact(responses, axis.frame)
    penalty = 1.0 / (instrument.lateral_penalty * spacing)
    for number in range(count):
        ends = axis.tip_position((number + 1) * spacing), axis.tip_position(number * spacing)
        trial = contact.trial(instrument.tip_and_segment(*ends))
        contact.append_segment(trial, 1, 0.0, np.zeros(len(axis.lateral_directions)), penalty)
    return contact
