"""A plan by the paper's own method, beside ours (R. Alterovitz et al., IROS 2003).

Nodes on the needle, lumped mass, Newmark's steps of 1/30 s, golden section over the height.
"""

import dataclasses
import time

import numpy as np

from needlefem._arrays import Vector
from needlefem.alterovitz2003.simulation import InTime, NodeSimulation
from needlefem.errors import CaseError
from needlefem.insertion.result import Insertion
from needlefem.insertion.simulation import Simulation, Watch, discretised
from needlefem.insertion.trajectory import TipPoint
from needlefem.planning.planner import Planner
from needlefem.planning.reading import InsertionReader
from needlefem.planning.result import Evidence, Plan, with_headline
from needlefem.scene import BoxMesh, Scene, contour_sizes, vary

SKIPPED = {
    "retraction": "elastic tissue and the first seed: it comes to rest where it was released",
    "reassembly": "matrices change around moved nodes only, as a correction of one factor",
}
NOT_MADE = dict.fromkeys(("estimate", "energy", "validity"), "not made for the paper's method")
DRIFT_REFINEMENTS = (1, 2)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Timed:
    """A plan and what it cost.

    Parameters
    ----------
    name : str
    plan : Plan
    seconds : float
        Of processor time for model and search, without checks and evidence.
    steps : int
        Time steps; 0 for a march.
    """

    name: str
    plan: Plan
    seconds: float
    steps: int = 0


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Drifted:
    """Where an unplanned seed ends on one mesh.

    Parameters
    ----------
    refined : int
        How many times finer than the case's the mesh is.
    status : str
        Of the insertion.
    placed_at : array, shape (dim,), m, or None
        None: the tip never was at the target.
    punctured_at : float, m, or None
        Depth at which the skin was cut.
    """

    refined: int
    status: str
    placed_at: Vector | None
    punctured_at: float | None


def paper_plan(
    scene: Scene, numbers: InTime | None = None, target: Vector | None = None,
    *, watch: Watch | None = None,
) -> Timed:  # fmt: skip
    """Plan by the paper's method.

    Parameters
    ----------
    scene : Scene
        Of P1 triangles in the plane.
    numbers : InTime, optional
        Those of the paper when left out.
    target : array, shape (dim,), m, optional
    watch : callable, optional

    Raises
    ------
    CaseError
        The scene can't be built, has other elements, or no target in the tissue.
    CheckFailedError
        The discretisation fails a check.
    """
    begin = time.process_time()
    simulation = NodeSimulation(scene, numbers, watch=watch)
    planner = Planner(simulation, _target(scene, target))
    model = time.process_time()
    checks = simulation.check(planner.entry)
    ready = time.process_time()
    found = planner.plan("golden")
    end = time.process_time()
    evidence = Evidence(
        preflight=checks,
        ledger=None,
        validity=None,
        missing=NOT_MADE,
        discretisation=discretised(simulation, planner.entry),
        warnings=(*simulation.warnings, *_warnings(simulation)),
        skipped=SKIPPED,
        reasons=simulation.resolved.reasons,
        timings={"model": model - begin, "preflight": ready - model, "search": end - ready},
    )
    name = "conforming, needle as thick as ours" if simulation.numbers.spread else "the paper's"
    return Timed(
        name=name,
        plan=with_headline(found, evidence),
        seconds=model - begin + end - ready,
        steps=simulation.time_steps,
    )


def own_plan(scene: Scene, search: str = "root", target: Vector | None = None) -> Timed:
    """Plan by a march and a search, to compare with."""
    begin = time.process_time()
    planner = Planner(Simulation(scene), _target(scene, target))
    found = planner.plan(search)
    return Timed(name=f"ours, {search}", plan=found, seconds=time.process_time() - begin)


def _target(scene: Scene, target: Vector | None) -> Vector:
    chosen = target if target is not None else scene.target
    if chosen is None:
        raise CaseError("target.point", "missing", "give a target to plan for")
    return np.asarray(chosen, dtype=float)


def _warnings(simulation: NodeSimulation) -> list[str]:
    found = []
    if not simulation.numbers.spread:
        found.append("forces act on nodes: the answer drifts with every refinement")
    if simulation.waited:
        found.append(
            f"in {simulation.waited} of {simulation.time_steps} steps the tip held for want of a "
            "node that could follow it"
        )
    return found


def refined(scene: Scene, times: int) -> Scene:
    """Return the scene on a mesh with elements so many times smaller.

    Raises
    ------
    CaseError
        The mesh is not a box.
    """
    if not isinstance(scene.mesh, BoxMesh):
        raise CaseError("mesh", "only boxes are refined here", "compare on meshes of your own")
    wanted = scene.mesh
    return vary(
        scene,
        {
            "mesh.divisions": tuple(times * n for n in wanted.divisions),
            "mesh.refine.corridor_size": wanted.refine.corridor_size / times,
            **contour_sizes(scene, 1.0 / times),
        },
    )


def drift(
    scene: Scene, numbers: InTime | None, refinements: tuple[int, ...] = DRIFT_REFINEMENTS
) -> list[Drifted]:
    """Return where the unplanned seed of the case ends on finer meshes.

    Parameters
    ----------
    scene : Scene
    numbers : InTime or None
        None: by our march.
    refinements : tuple of int
    """
    found = []
    for times in refinements:
        finer = refined(scene, times)
        simulation = Simulation(finer) if numbers is None else NodeSimulation(finer, numbers)
        reach, insertion = unplanned(simulation, _target(scene, None))
        found.append(
            Drifted(
                refined=times,
                status=str(insertion.outcome.status),
                placed_at=None if reach is None else reach.point,
                punctured_at=insertion.puncture_depth,
            )
        )
    return found


def unplanned(simulation: Simulation, target: Vector) -> tuple[TipPoint | None, Insertion]:
    """Return what the tip has reached when it is at the target in the world, and how.

    None: the insertion ended before.
    """
    entry = simulation.entry_through(target)
    depth = float(simulation.direction @ (target - entry.point))
    insertion = simulation.insert(entry, lambda state: state.depth > depth + 2e-3)
    return InsertionReader(insertion, target).at_depth(depth).reach, insertion
