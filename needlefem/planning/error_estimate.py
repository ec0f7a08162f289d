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
from needlefem.planning.reading import ROUND_OFF, InsertionReader, at_jump, broke_off, state_at
from needlefem.planning.result import ErrorEstimate, Plan
from needlefem.scene import BoxMesh, Scene, vary
from needlefem.scene.build import build_model
from needlefem.scene.resolve import quadratic

HALVED = 1.5
"""Error over the difference to cells of half the size: that of order 1.6. Supported corners at
the skin have less, smooth tissue more (``needlefem study accuracy``)."""
KERNEL = 4
"""Times as many points of the kernel on the finer tissue."""
SAFETY = 3.0
"""Stated error over the estimated one. A grid convergence index takes this factor where two grids
are compared and the order is assumed (P. J. Roache, J. Fluids Eng. 116, 1994). The largest ratio
of the true error to the estimated one that was measured is 2.5 (docs/theory.md)."""
SHORT_PATH = 0.5
"""Path spacing over the tip's radius up to which what it does to a placement is left out: there
the safety factor covers it, and an insertion is spared."""


class NoEstimateError(Exception):
    """The error of a plan can't be estimated; the message says why."""


def estimate(simulation: Simulation, plan: Plan, *, path: bool = False) -> ErrorEstimate:
    """Return how far from the target a plan places.

    Parameters
    ----------
    simulation : Simulation
        That the plan was made on.
    plan : Plan
    path : bool
        Whether to add what the path's spacing does, which takes an insertion, even if the pieces
        are short against the tip's radius (`SHORT_PATH`).

    Raises
    ------
    NoEstimateError
        The plan has no release, or one at which the tip has not cut the skin or jumps; or an
        insertion that the estimate needs broke off.
    """
    _refuse_unusable(plan)
    finer, how, factor = finer_tissue(simulation)
    offset = displacement_on(finer, simulation, plan)
    contours = _fitted_to(simulation.scene)
    if contours and finer.model.mesh is not simulation.model.mesh:
        # straight edges cut a contour's corners; that may cancel the rest: the larger counts
        rounder = build_model(
            finer.scene, meshes.uniformly_refined(simulation.model.mesh, contours)
        )
        other = displacement_on(Simulation(finer.scene, rounder), simulation, plan)
        offset = max(offset, other, key=lambda move: float(np.linalg.norm(move)))
    path = path or _long_pieces(simulation.scene)
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


def _long_pieces(scene: Scene) -> bool:
    """Say whether the path's pieces are so long that they matter beside the mesh."""
    return scene.discretization.path_spacing > (SHORT_PATH + ROUND_OFF) * scene.needle.tip_radius


def _refuse_unusable(plan: Plan) -> None:
    """Raise a `NoEstimateError` for a plan whose release can't be followed to another tissue."""
    cut, best = plan.insertion.puncture_depth, plan.best
    if best is None:
        raise NoEstimateError("there is no release")
    if broke_off(plan.insertion):
        raise NoEstimateError("the insertion broke off")
    depth = float(plan.insertion.axis.axial_coordinate(best.release_point))
    if cut is None or depth <= cut:
        raise NoEstimateError("the skin is not cut where the tip releases")
    if at_jump(plan.insertion, depth):
        raise NoEstimateError("the tip jumps at the depth of the release")


def finer_tissue(simulation: Simulation) -> tuple[Simulation, str, float]:
    """Return the scene on a finer tissue, what is finer, and error over difference to it."""
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
    """Return the contours that the scene's mesh follows."""
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
    """Return how far from where it was planned a release rests on another tissue.

    Parameters
    ----------
    finer : Simulation
        Of the same scene, on another tissue.
    simulation : Simulation
        That the plan was made on.
    plan : Plan
        Whose tip has cut the skin where it releases.

    Returns
    -------
    array, shape (dim,), m
    """
    assert plan.best is not None
    insertion = plan.insertion
    number = state_at(insertion, float(insertion.axis.axial_coordinate(plan.best.release_point)))
    if not _marched(insertion, number):
        return _carried_out(finer, plan)
    axis, state = insertion.axis, insertion.states[number]
    own = _Contact(simulation.model, axis.frame, _on_own(insertion, number))
    other = _Contact(finer.model, axis.frame, _on_finer(finer, insertion, number))
    tip = np.concatenate([[state.tip_force], state.tip_lateral])
    forces = np.vstack([tip, np.column_stack([state.friction_force, state.lateral_force])])
    change = other.moved(forces, _solver(finer.model, simulation.model)) - own.moved(forces)
    held = np.array([piece.compliance for piece in insertion.pieces[: len(state.friction_force)]])
    at_tip = change[0] + own.follow(change[1:, 1:], held, simulation.responses)
    moved: Vector = -at_tip[0] * _rate(insertion, number) - at_tip[1:] @ axis.lateral_directions
    return moved


def _marched(insertion: Insertion, number: int) -> bool:
    """Say whether every state up to one cut a piece, as on a march that nothing stopped."""
    first = insertion.first_cut
    if first is None or insertion.energies is not None:  # which only steps keep
        return False
    return len(insertion.states[number].friction_force) == number - first + 1


def _rate(insertion: Insertion, number: int) -> Vector:
    """Return how the material point at the tip moves with depth, shape (dim,)."""
    depth = float(insertion.depths[number] - insertion.depths[number - 1])
    if depth <= 0.0:  # a snap ends there
        return insertion.axis.direction
    ahead: Vector = (insertion.tips[number] - insertion.tips[number - 1]) / depth
    return ahead


def path_error(simulation: Simulation, plan: Plan) -> float:
    """Return what the path's spacing does to the placement, m.

    A third of the move with twice the spacing: its order is near two.
    """
    twice = 2.0 * simulation.scene.discretization.path_spacing
    coarser = Simulation(
        vary(simulation.scene, {"discretization.path_spacing": twice}), simulation.model
    )
    coarser.responses = simulation.responses
    return float(np.linalg.norm(_carried_out(coarser, plan))) / 3.0


def _carried_out(other: Simulation, plan: Plan) -> Vector:
    """Return how far from where it was planned a release rests, by a whole insertion.

    Raises
    ------
    NoEstimateError
        It broke off, or ended before.
    """
    assert plan.best is not None
    entry = other.entry_through(plan.best.release_point)
    depth = float(plan.insertion.axis.axial_coordinate(plan.best.release_point))
    beyond = depth + 3.0 * other.scene.discretization.path_spacing
    found = other.insert(entry, lambda state: state.depth > beyond)
    reading = InsertionReader(found, plan.target).at_depth(depth)
    if reading.reach is None:
        raise NoEstimateError(f"on the tissue to compare with, {reading.sentence}")
    return np.asarray(reading.reach.point - plan.best.placed_at)


def _solver(finer: TissueModel, coarser: TissueModel) -> Callable[[Floats], Floats]:
    """Return what solves on the finer tissue: cheaper where no element has a pressure."""
    if finer.element.definite and coarser.element.definite:
        return TwoLevelSolver(finer, coarser).solve
    return finer.solve


class _Contact:
    """What the needle touches in one tissue: the tip, then the pieces that it lies in.

    Parameters
    ----------
    model : TissueModel
    frame : array, shape (dim, dim)
        The needle's.
    means : sparse array, shape (1 + npieces, nnodes)
        Mean displacements over the tip's kernel and over the pieces are ``means @ field``.
    """

    def __init__(self, model: TissueModel, frame: Floats, means: Sparse) -> None:
        self._model, self._frame, self._means = model, frame, means

    def moved(self, forces: Floats, solve: Callable[[Floats], Floats] | None = None) -> Floats:
        """Return displacements under forces, both (1 + npieces, dim) and in the needle's frame."""
        load = self._model.dof_vector(self._means.T @ (forces @ self._frame))
        field = self._model.nodal((solve or self._model.solve)(load))
        found: Floats = self._means @ field @ self._frame.T
        return found

    def follow(self, gaps: Floats, held: Floats, responses: ComplianceOperator) -> Vector:
        """Return how the tip moves when the shaft is brought back onto the axis, shape (dim,).

        Parameters
        ----------
        gaps : array, shape (npieces, dim - 1), m
            By which the pieces are off.
        held : array, shape (npieces,), m/N
            Compliance of their lateral hold.
        responses : ComplianceOperator
            Of this tissue, where the needle touched it.
        """
        functionals = self._rows(responses)
        lateral = np.arange(functionals.shape[0]).reshape(-1, self._model.dim)[1:, 1:].ravel()
        fields = np.empty((responses.size, len(lateral)))
        for column, row in enumerate(lateral):
            own = slice(*functionals.indptr[row : row + 2])
            load = functionals.data[own][None]
            fields[:, column] = responses.respond(functionals.indices[own], load).after(0)[:, 0]
        moved = functionals @ fields
        stiff = moved[lateral] + np.diag(np.repeat(held, gaps.shape[1]))
        found: Vector = -moved[: self._model.dim] @ np.linalg.solve(stiff, gaps.ravel())
        return found

    def _rows(self, responses: ComplianceOperator) -> Sparse:
        """Return the functionals' components over the rows of the responses."""
        touched = np.unique(self._means.indices)
        slots, dim = responses.rows(touched).reshape(len(touched), -1), self._model.dim
        weights = sparse.kron(self._means.tocsc()[:, touched], self._frame)
        if responses.frames is not None:
            loads = responses.frames.local_loads(touched, weights.toarray())
            weights = sparse.coo_array(loads)
        entries = weights.tocoo()
        columns = slots[entries.col // dim, entries.col % dim]
        shape = (entries.shape[0], responses.size)
        return sparse.csr_array((entries.data, (entries.row, columns)), shape=shape)


def _on_own(insertion: Insertion, number: int) -> Sparse:
    """Return the functionals as the insertion had them in a state."""
    state = insertion.states[number]
    own = [(state.tip_nodes, state.tip_weights)]
    own += [(piece.nodes, piece.weights) for piece in state.filled(insertion.pieces)]
    return _means(own, insertion.model.nnodes)


def _on_finer(finer: Simulation, insertion: Insertion, number: int) -> Sparse:
    """Return the same functionals on another tissue."""
    first = insertion.first_cut
    assert first is not None
    needle = finer.instrument(
        finer.entry_through(insertion.axis.tip_position(insertion.depths[number]))
    )
    path = insertion.tips[first : number + 1]
    parts = [needle.tip(insertion.tips[number]), needle.tip(path[0]), needle.pieces(path)]
    return _means([(part.nodes, row) for part in parts for row in part.rows], finer.model.nnodes)


def _means(functionals: list[tuple[Ints, Floats]], nnodes: int) -> Sparse:
    """Return functionals, each its nodes and their weights, as rows over all nodes."""
    rows = np.repeat(np.arange(len(functionals)), [len(nodes) for nodes, _ in functionals])
    nodes, weights = (np.concatenate(parts) for parts in zip(*functionals, strict=True))
    found = sparse.csr_array((weights, (rows, nodes)), shape=(len(functionals), nnodes))
    found.eliminate_zeros()
    return found
