"""Estimate of the placement error of a plan on a finer tissue.

The error is the final position of the release on the exact tissue, minus the target. The forces of
the planned release are applied to a finer tissue: each cell is divided into cells of half its size
or, for linear elements, the quadratic element is used on the same cells. The displacement there
differs. Shaft and tip are constrained to the needle axis there too, so that the lateral forces
follow by the compliance of the plan. The remaining offset at the tip, divided by the derivative of
depth along the path, is the change of the final position. This needs the finer stiffness and a few
dozen back-substitutions with the factorisation of the plan. The cut path in the material is that of
the plan, although the tip would have left it sideways on the finer tissue: a complete insertion has
the same error along the needle, but may have several times the error across it. The stated error
therefore has a safety factor.
"""

from collections.abc import Callable

import numpy as np
from scipy import sparse

# the module of this folder that refines meshes is imported when it is first used
from needlefem import mesh as meshes
from needlefem._arrays import Floats, Ints, Sparse, Vector
from needlefem.fem.compliance import ComplianceOperator
from needlefem.fem.tissue_model import TissueModel
from needlefem.fem.two_level_solver import TwoLevelSolver
from needlefem.geometry.contour import Contour
from needlefem.insertion.result import Insertion
from needlefem.insertion.simulation import Simulation
from needlefem.planning.reading import ROUND_OFF, InsertionReader, at_rupture, ended_early, state_at
from needlefem.planning.result import ErrorEstimate, Plan
from needlefem.scene import BoxMesh, Scene, vary
from needlefem.scene.build import build_model
from needlefem.scene.resolve import quadratic

HALVED = 1.5
"""Error over the difference to cells of half the size, for the order 1.6. The order is lower at
supported corners of the skin and higher in smooth tissue (``needlefem study accuracy``)."""
KERNEL = 4
"""Quadrature points of the tip kernel on the finer tissue, over those of the plan."""
SAFETY = 3.0
"""Stated error over the estimated error. The grid convergence index has this factor if two grids
are compared and the order is assumed (P. J. Roache, J. Fluids Eng. 116, 1994). The largest
measured ratio of the true error to the estimated error is 2.5 (docs/theory.md)."""
SHORT_PATH = 0.5
"""Path spacing over the tip radius up to which its effect on the placement is omitted. The safety
factor covers the effect, and no further insertion is needed."""


class NoEstimateError(Exception):
    """The error of a plan cannot be estimated; the message states the reason."""


def estimate(simulation: Simulation, plan: Plan, *, path: bool = False) -> ErrorEstimate:
    """Return the estimated placement error of a plan on exact tissue.

    Parameters
    ----------
    simulation : Simulation
        Simulation of the plan.
    plan : Plan
    path : bool
        Whether to include the effect of the path spacing even if it is small compared to the tip
        radius (`SHORT_PATH`). This needs a further insertion.

    Raises
    ------
    NoEstimateError
        The plan has no release; the skin is not cut at the release, or a rupture occurs at its
        depth; or an insertion for the estimate ended early.
    """
    _refuse_unusable(plan)
    finer, how, factor = finer_tissue(simulation)
    offset = displacement_on(finer, simulation, plan)
    contours = _fitted_to(simulation.scene)
    if contours and finer.model.mesh is not simulation.model.mesh:
        # straight edges approximate the contour; both errors may cancel, so the larger is used
        rounder = build_model(
            finer.scene, meshes.uniformly_refined(simulation.model.mesh, contours)
        )
        other = displacement_on(Simulation(finer.scene, rounder), simulation, plan)
        offset = max(offset, other, key=lambda move: float(np.linalg.norm(move)))
    path = path or _long_segments(simulation.scene)
    by_path = path_error(simulation, plan) if path else None
    error = factor * float(np.linalg.norm(offset)) + (by_path or 0.0)
    return ErrorEstimate(
        error=error,
        at_most=SAFETY * error,
        path=by_path,
        offset=offset,
        compared_to=how,
        unknowns=len(finer.model.free_dofs),
    )


def _long_segments(scene: Scene) -> bool:
    """Say whether the contact segments are so long that they affect the placement."""
    return scene.discretization.path_spacing > (SHORT_PATH + ROUND_OFF) * scene.needle.tip_radius


def _refuse_unusable(plan: Plan) -> None:
    """Raise a `NoEstimateError` for a plan whose release cannot be evaluated on another tissue."""
    cut, best = plan.insertion.puncture_depth, plan.best
    if best is None:
        raise NoEstimateError("there is no release")
    if ended_early(plan.insertion):
        raise NoEstimateError("the insertion ended early")
    depth = float(plan.insertion.axis.axial_coordinate(best.release_point))
    if cut is None or depth <= cut:
        raise NoEstimateError("the skin is not cut at the release")
    if at_rupture(plan.insertion, depth):
        raise NoEstimateError("the tip advances at the depth of the release (rupture)")


def finer_tissue(simulation: Simulation) -> tuple[Simulation, str, float]:
    """Return a simulation on finer tissue, its name, and the ratio of error to difference."""
    scene, mesh, row = simulation.scene, simulation.model.mesh, simulation.model.element
    points = {
        "discretization.tip_quadrature_points": KERNEL * scene.discretization.tip_quadrature_points
    }
    if row.degree == 1 and scene.dim == 2:
        better = quadratic(scene)
        finer = vary(scene, {**points, "discretization.element": better})
        model = build_model(finer, mesh)
        model.locate_as(simulation.model)
        return Simulation(finer, model), f"{better} on the same cells", 1.0
    finer = vary(scene, points)
    model = build_model(finer, meshes.uniformly_refined(mesh))
    return Simulation(finer, model), f"{row.name} on cells half as large", HALVED


def _fitted_to(scene: Scene) -> list[Contour]:
    """Return the contours to which the mesh of a scene is fitted."""
    if not isinstance(scene.mesh, BoxMesh) or scene.mesh.interfaces != "fitted":
        return []
    return [region.contour for region in scene.regions.values()]


# Kernel: rest position of the planned release on a finer tissue.
#     dX = -(c.e) dX/ds - (c.n) n,    c = u_f(X) - u(X),    K_f u_f = B_f^T f
# dX     difference of the rest position, m; dX/ds growth of the path with depth
# c      difference of the displacement at the tip's kernel, m; lateral forces follow the axis
# K_f    stiffness of the finer tissue, N/m (Pa in 2D); u_f, u on the finer and the plan's tissue
# f      forces of the planned release on tip and segments, N (N/m in 2D)
# e, n   unit vectors along and across the axis
# Source: estimate by a refined solution, P. J. Roache, J. Fluids Eng. 116 (1994) 405.
def displacement_on(finer: Simulation, simulation: Simulation, plan: Plan) -> Vector:
    """Return the change of a release's final position on another tissue.

    Parameters
    ----------
    finer : Simulation
        Simulation of the same scene on another tissue.
    simulation : Simulation
        Simulation of the plan.
    plan : Plan
        The skin is cut at its release.

    Returns
    -------
    array, shape (dim,), m
    """
    assert plan.best is not None
    insertion = plan.insertion
    number = state_at(insertion, float(insertion.axis.axial_coordinate(plan.best.release_point)))
    if not _one_segment_per_state(insertion, number):
        return _complete_insertion(finer, plan)
    axis, state = insertion.axis, insertion.states[number]
    own = _Contact(simulation.model, axis.frame, _on_own(insertion, number))
    other = _Contact(finer.model, axis.frame, _on_finer(finer, insertion, number))
    tip = np.concatenate([[state.tip_force], state.tip_lateral])
    forces = np.vstack([tip, np.column_stack([state.friction_force, state.lateral_force])])
    change = other.moved(forces, _solver(finer.model, simulation.model)) - own.moved(forces)
    compliances = np.array(
        [segment.compliance for segment in insertion.segments[: len(state.friction_force)]]
    )
    at_tip = change[0] + own.follow(change[1:, 1:], compliances, simulation.responses)
    moved: Vector = -at_tip[0] * _rate(insertion, number) - at_tip[1:] @ axis.lateral_directions
    return moved


def _one_segment_per_state(insertion: Insertion, number: int) -> bool:
    """Say whether each state up to one cuts one segment, as in path following."""
    first = insertion.first_cut
    if first is None or insertion.energies is not None:  # only time stepping stores energies
        return False
    return len(insertion.states[number].friction_force) == number - first + 1


def _rate(insertion: Insertion, number: int) -> Vector:
    """Return the derivative of the material point at the tip with respect to the depth.

    Shape (dim,).
    """
    depth = float(insertion.depths[number] - insertion.depths[number - 1])
    if depth <= 0.0:  # a rupture ends in this state
        return insertion.axis.direction
    ahead: Vector = (insertion.tips[number] - insertion.tips[number - 1]) / depth
    return ahead


def path_error(simulation: Simulation, plan: Plan) -> float:
    """Return the effect of the path spacing on the placement, m.

    It is a third of the change with twice the spacing, for the order two.
    """
    twice = 2.0 * simulation.scene.discretization.path_spacing
    coarser = Simulation(
        vary(simulation.scene, {"discretization.path_spacing": twice}), simulation.model
    )
    coarser.responses = simulation.responses
    return float(np.linalg.norm(_complete_insertion(coarser, plan))) / 3.0


def _complete_insertion(other: Simulation, plan: Plan) -> Vector:
    """Return the change of a release's final position, computed by a complete insertion.

    Raises
    ------
    NoEstimateError
        The insertion ended before the release.
    """
    assert plan.best is not None
    entry = other.entry_through(plan.best.release_point)
    depth = float(plan.insertion.axis.axial_coordinate(plan.best.release_point))
    beyond = depth + 3.0 * other.scene.discretization.path_spacing
    found = other.insert(entry, lambda state: state.depth > beyond)
    reading = InsertionReader(found, plan.target).at_depth(depth)
    if reading.reach is None:
        raise NoEstimateError(f"in the tissue for comparison, {reading.sentence}")
    return np.asarray(reading.reach.point - plan.best.placed_at)


def _solver(finer: TissueModel, coarser: TissueModel) -> Callable[[Floats], Floats]:
    """Return the solver for the finer tissue: two-level if no element has a pressure."""
    if finer.element.definite and coarser.element.definite:
        return TwoLevelSolver(finer, coarser).solve
    return finer.solve


class _Contact:
    """Functionals of the contact in one tissue: the tip kernel, then the contact segments.

    Parameters
    ----------
    model : TissueModel
    frame : array, shape (dim, dim)
        The needle's frame.
    means : sparse array, shape (1 + nsegments, nnodes)
        ``means @ field`` are the mean displacements over the tip kernel and over the segments.
    """

    def __init__(self, model: TissueModel, frame: Floats, means: Sparse) -> None:
        self._model, self._frame, self._means = model, frame, means

    def moved(self, forces: Floats, solve: Callable[[Floats], Floats] | None = None) -> Floats:
        """Return the mean displacements under forces on the functionals.

        Both have the shape (1 + nsegments, dim) and are in the needle's frame.
        """
        load = self._model.dof_vector(self._means.T @ (forces @ self._frame))
        field = self._model.nodal((solve or self._model.solve)(load))
        found: Floats = self._means @ field @ self._frame.T
        return found

    def follow(self, gaps: Floats, compliances: Floats, responses: ComplianceOperator) -> Vector:
        """Return the displacement of the tip when the shaft is returned to the axis, m.

        Shape (dim,).

        Parameters
        ----------
        gaps : array, shape (nsegments, dim - 1), m
            Lateral distance of the segments from the axis.
        compliances : array, shape (nsegments,), m/N
            Compliance of their lateral penalty.
        responses : ComplianceOperator
            Compliances of this tissue.
        """
        functionals = self._rows(responses)
        lateral = np.arange(functionals.shape[0]).reshape(-1, self._model.dim)[1:, 1:].ravel()
        fields = np.empty((responses.size, len(lateral)))
        for column, row in enumerate(lateral):
            own = slice(*functionals.indptr[row : row + 2])
            load = functionals.data[own][None]
            fields[:, column] = responses.respond(functionals.indices[own], load).after(0)[:, 0]
        moved = functionals @ fields
        matrix = moved[lateral] + np.diag(np.repeat(compliances, gaps.shape[1]))
        found: Vector = -moved[: self._model.dim] @ np.linalg.solve(matrix, gaps.ravel())
        return found

    def _rows(self, responses: ComplianceOperator) -> Sparse:
        """Return the components of the functionals over the rows of the compliance operator."""
        touched = np.unique(self._means.indices)
        slots, dim = responses.rows(touched).reshape(len(touched), -1), self._model.dim
        weights = sparse.kron(self._means.tocsc()[:, touched], self._frame)
        if responses.frames is not None:
            loads = responses.frames.local_loads(touched, weights.toarray())
            weights = sparse.coo_array(loads)
        entries = weights.tocoo()
        columns = slots[entries.col // dim, entries.col % dim]
        shape = (entries.shape[0], responses.size)
        found: Sparse = sparse.csr_array((entries.data, (entries.row, columns)), shape=shape)
        return found


def _on_own(insertion: Insertion, number: int) -> Sparse:
    """Return the functionals of a state of the insertion."""
    state = insertion.states[number]
    own = [(state.tip_nodes, state.tip_weights)]
    own += [(segment.nodes, segment.weights) for segment in state.filled(insertion.segments)]
    return _means(own, insertion.model.nnodes)


def _on_finer(finer: Simulation, insertion: Insertion, number: int) -> Sparse:
    """Return the same functionals on another tissue."""
    first = insertion.first_cut
    assert first is not None
    needle = finer.instrument(
        finer.entry_through(insertion.axis.tip_position(insertion.depths[number]))
    )
    path = insertion.tips[first : number + 1]
    parts = [needle.tip(insertion.tips[number]), needle.tip(path[0]), needle.segments(path)]
    return _means([(part.nodes, row) for part in parts for row in part.rows], finer.model.nnodes)


def _means(functionals: list[tuple[Ints, Floats]], nnodes: int) -> Sparse:
    """Return functionals, each given by nodes and weights, as rows over all nodes."""
    rows = np.repeat(np.arange(len(functionals)), [len(nodes) for nodes, _ in functionals])
    nodes, weights = (np.concatenate(parts) for parts in zip(*functionals, strict=True))
    found: Sparse = sparse.csr_array((weights, (rows, nodes)), shape=(len(functionals), nnodes))
    found.eliminate_zeros()
    return found
