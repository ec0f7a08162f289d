"""The data that all insertions in one scene share: tissue, compliances, and needles on any axis."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem._progress import doing, expect_steps
from needlefem.checks.mesh_checks import needle_resolution, preflight, sizes_along
from needlefem.checks.result import CheckResult, refuse_failed
from needlefem.errors import CaseError
from needlefem.fem.compliance import ComplianceOperator, Corridor
from needlefem.fem.factorization import lasting_state
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.insertion_run import InsertionRun, KeptStates, SaveAt, longest_travel
from needlefem.insertion.motion_schedule import deepest
from needlefem.insertion.result import Insertion
from needlefem.insertion.state import State
from needlefem.insertion.tip_solver import WarmStart
from needlefem.insertion.tissue_response import (
    ElasticResponse,
    ExpectedLoads,
    TissueResponse,
    responses_of,
)
from needlefem.materials import branches_of
from needlefem.materials.linearity import refuse_nonlinear
from needlefem.mesh.generation import BACKGROUND, cell_sizes
from needlefem.mesh.surface import Entry, check_entry, entry_along, entry_at
from needlefem.needle.needle_interface import (
    InsertionAxis,
    Kernel,
    NeedleInterface,
    PointKernel,
    TipKernel,
    cross_section,
)
from needlefem.scene import DYNAMIC, Motion, Scene
from needlefem.scene.build import build_model
from needlefem.scene.limits import check_scene
from needlefem.scene.resolve import Resolved, resolve, stick_warnings

if TYPE_CHECKING:
    from needlefem.contact.friction import SlipWeakeningFriction
    from needlefem.insertion.sticking import Sticking


Stop = Callable[[State], bool]
"""Called after each state; says whether the insertion may stop."""
Watch = Callable[[State], None]
"""Called after each state, to show progress."""


CORRIDOR = 2.0
"""Half-width of the corridor around the needle axes, over the tip radius: the radius of the needle,
and as much for the lateral displacement of its path."""
EXPECTED_INSERTIONS = 5
"""Typical number of insertions of a plan."""


class Simulation:
    """Everything that insertions in one scene share.

    Parameters
    ----------
    scene : Scene
        The scene as read; it is resolved here.
    model : TissueModel, optional
        The discretized tissue of the scene, if it was built before.
    watch : callable, optional
        Called with each state of each insertion.
    expected_insertions : int, optional
        Expected number of insertions. It decides how compliances are computed, not their values.

    Raises
    ------
    CaseError
        The scene cannot be built, exceeds its limits, or has a nonlinear constitutive law.
    """

    def __init__(
        self,
        scene: Scene,
        model: TissueModel | None = None,
        watch: Watch | None = None,
        *,
        expected_insertions: int = EXPECTED_INSERTIONS,
    ) -> None:
        self._watch, self._expected = watch, expected_insertions
        self.resolved: Resolved = resolve(scene)
        self.scene = self.resolved.scene
        for name, law in self.scene.materials.items():
            refuse_nonlinear(law, f"materials.{name}")
        check_scene(self.scene)
        self.model = build_model(self.scene) if model is None else model
        self._refuse_wide_tip()
        self.direction: Vector = np.array(self.scene.motion.direction)
        self.insertions = 0
        self._checks: dict[tuple[float, ...], tuple[CheckResult, ...]] = {}
        self._warm_start: WarmStart | None = None
        self._sticking: Sticking | None = None
        laws = self.scene.materials.values()
        self._memory = any(branches_of(law, self.scene.dim, self.scene.plane) for law in laws)

    def __getstate__(self) -> dict[str, object]:
        """Return the data to pickle: without `watch`, and without compliances.

        Compliances are computed again after unpickling.
        """
        return lasting_state(self) | {"_watch": None}

    def _refuse_wide_tip(self) -> None:
        """Raise a `CaseError` if the tip is wider than the tissue: its force would act outside."""
        radius, extents = self.scene.needle.tip_radius, np.ptp(self.model.mesh.p, axis=1)
        if 2.0 * radius > extents.min():
            problem = f"a tip of {2.0 * radius:g} m is wider than the tissue, {extents.min():g} m"
            raise CaseError("needle.tip_radius", problem, "give a smaller radius")

    @property
    def reasons(self) -> dict[str, str]:
        """Reasons for all automatic choices, including those made together with the compliances."""
        found = dict(self.resolved.reasons)
        if "responses" in vars(self):
            unknowns, responses = len(self.model.free_dofs), self.responses
            found["factorisation"] = f"{self.model.factor.name}: {unknowns} unknowns"
            cost = f"{responses.size} rows, {responses.solves} back-substitutions"
            found["responses"] = f"{responses.way}: {cost}"
        if self._sticking is not None and self._sticking.reason:
            found["tangential_penalty"] = self._sticking.reason
        return found

    @property
    def warnings(self) -> tuple[str, ...]:
        """Limitations of the results that the user should know."""
        found = self.resolved.warnings
        if self._sticking is None or not self._sticking.reason:
            return found
        chosen = f"needle.tangential_penalty is chosen: {self._sticking.reason}"
        rigid = stick_warnings(self.scene)  # they hold for rigid sticking only
        return (*(warning for warning in found if warning not in rigid), chosen)

    @property
    def steps(self) -> bool:
        """Whether the motion of the scene may need time stepping."""
        motion = self.scene.motion
        path_following = self.scene.discretization.integrator == "path_following"
        return not path_following or bool(motion.stages or motion.times)

    def check(self, entry: Entry | None = None) -> tuple[CheckResult, ...]:
        """Run the preflight: the checks that tissue and needle must pass before an insertion.

        The result is stored. The insertions use the factorization that the checks computed.

        Parameters
        ----------
        entry : Entry, optional
            Entry of the needle; that of the case when left out.

        Raises
        ------
        CaseError
            The case has no entry.
        CheckFailedError
            A check failed.
        """
        entry = self.entry_of_case() if entry is None else entry
        key = tuple(float(x) for x in entry.point)
        if key not in self._checks:
            doing("checking the mesh")
            checks = [*preflight(self.model), needle_resolution(self, entry)]
            if self.steps:  # nothing sticks in path following
                from needlefem.insertion.sticking import sticking_segments  # noqa: PLC0415

                checks.append(sticking_segments(self.sticking(entry)))
            refuse_failed(checks)
            self._checks[key] = tuple(checks)
        return self._checks[key]

    @cached_property
    def responses(self) -> ComplianceOperator:
        """Compliances of the tissue, shared by all insertions."""
        return responses_of(self.model, expected=self._expected_loads())

    def _expected_loads(self, insertions: int | None = None) -> ExpectedLoads | None:
        """Return the corridor of the needles and the number of loads on one operator.

        None if the scene has no entry.

        Parameters
        ----------
        insertions : int, optional
            Number of insertions that use the operator; those expected of the simulation when left
            out. In tissue that depends on time, each insertion and each duration of a step has its
            own.
        """
        scene, corridor = self.scene, self._corridor
        if corridor is None:
            return None
        insertions = self._expected if insertions is None else insertions
        if self.steps:
            travel = deepest(scene.motion) * max(len(scene.motion.stages), 1)
            steps = int(np.ceil(travel / longest_travel(scene)))
            return ExpectedLoads.of_steps(corridor, steps, insertions)
        segments = int(np.ceil(deepest(scene.motion) / scene.discretization.path_spacing))
        return ExpectedLoads.of_path(corridor, segments, insertions)

    @cached_property
    def _corridor(self) -> Corridor | None:
        """Corridor in which needles are expected; None if the scene has no entry."""
        scene = self.scene
        point = scene.motion.entry or scene.target
        if point is None:
            return None
        entry = entry_along(self.model.mesh, np.array(point), self.direction)
        if entry is None:
            return None
        aside = max(abs(offset) for offset in scene.planning.offset_range)
        end = entry.point + deepest(scene.motion) * self.direction
        return Corridor(entry.point, end, CORRIDOR * scene.needle.tip_radius + aside)

    @cached_property
    def cutting_force(self) -> Floats:
        """Nodal values of the cutting force, shape (nnodes,), N (N/m in 2D)."""
        own = {name: region.cutting_force for name, region in self.scene.regions.items()}
        return self._by_region(self.scene.needle.cutting_force, own)

    @cached_property
    def shaft_friction(self) -> Floats:
        """Nodal values of the shaft friction, shape (nnodes,), N/m (Pa in 2D)."""
        own = {name: region.shaft_friction for name, region in self.scene.regions.items()}
        return self._by_region(self.scene.needle.shaft_friction, own)

    def _by_region(self, common: float, own: Mapping[str, float | None]) -> Floats:
        values = {name: common if value is None else value for name, value in own.items()}
        return self.model.per_node({BACKGROUND: common} | values)

    def entry_through(self, point: Vector) -> Entry:
        """Return the entry of a needle whose axis goes through a point.

        Raises
        ------
        CaseError
            The axis does not meet the tissue, or the skin there is supported or too oblique.
        """
        found = entry_along(self.model.mesh, point, self.direction)
        if found is None:
            problem = "a needle on the line through the target misses the tissue"
            raise CaseError("motion.direction", problem, "move the target or turn the needle")
        self._check(found)
        return found

    def entry_of_case(self) -> Entry:
        """Return the entry of the case, or that of the axis through its target."""
        if self.scene.motion.entry:
            point = np.array(self.scene.motion.entry)
            found = entry_at(self.model.mesh, point, self.direction)
            self._check(found)
            return found
        if self.scene.target is None:
            raise CaseError("motion.entry", "missing", "give it, or a target to aim at")
        return self.entry_through(np.array(self.scene.target))

    def _check(self, entry: Entry) -> None:
        faces = {face for support in self.scene.supports.values() for face in support.faces}
        mesh = self.model.mesh
        named, regions = mesh.boundaries or {}, mesh.subdomains or {}
        fixed = [named[face] for face in sorted(faces)]
        for support in self.scene.supports.values():
            fixed += [mesh.t2f[:, regions[name]].ravel() for name in support.regions]
        facets = np.concatenate(fixed) if fixed else np.zeros(0, dtype=np.intp)
        check_entry(entry, self.direction, facets)

    def reach(self, entry: Entry) -> float:
        """Return the largest depth of the motion, limited to the depth at which the axis ends.

        The axis ends where it leaves the tissue.

        Parameters
        ----------
        entry : Entry
        """
        depth = deepest(self.scene.motion)
        end = entry.point + depth * self.direction
        share = self.model.interpolation.surface.first_exit(entry.point, end)
        return depth if share is None else share * depth

    def sticking(self, entry: Entry) -> "Sticking":
        """Return the tangential penalty; it is determined for the first entry and then stored.

        Raises
        ------
        CaseError
            The penalty of the scene is too stiff for the mesh.
        """
        from needlefem.insertion.sticking import sticking  # noqa: PLC0415

        if self._sticking is None:
            needle, reach = self.instrument(entry), self.reach(entry)
            self._sticking = sticking(self.scene.needle, needle, self.responses, reach)
        return self._sticking

    def friction(self, entry: Entry) -> "SlipWeakeningFriction":
        """Return the friction law for time stepping."""
        from needlefem.contact.friction import SlipWeakeningFriction  # noqa: PLC0415

        needle = self.scene.needle
        stiffness = self.sticking(entry).stiffness
        return SlipWeakeningFriction(
            needle.static_friction_ratio, needle.slip_weakening_distance, stiffness
        )

    def instrument(self, entry: Entry) -> NeedleInterface:
        """Return the needle on the axis that begins at an entry."""
        needle, numbers = self.scene.needle, self.scene.discretization
        radius, points = needle.tip_radius, numbers.tip_quadrature_points
        kernel: Kernel = TipKernel(radius, points, entry.point, entry.inward)
        section = cross_section(radius, points, self.model.dim)
        if needle.tip == "point":
            kernel, section = PointKernel(self.model.dim), cross_section(0.0, 1, self.model.dim)
        return NeedleInterface(
            axis=InsertionAxis(entry.point, self.direction),
            kernel=kernel,
            interpolation=self.model.interpolation,
            cutting_force=self.cutting_force,
            shaft_friction=self.shaft_friction,
            section=section,
            lateral_penalty=needle.lateral_penalty,
            spacing=numbers.path_spacing,
            inward=entry.inward,
        )

    def insert(
        self,
        entry: Entry,
        stop: Stop | None = None,
        *,
        max_depth: float | None = None,
        save: SaveAt | None = None,
    ) -> Insertion:
        """Push the needle to a depth, or until `stop` returns True.

        If the last insertion had a nearby entry, its solution gives the initial values.

        Parameters
        ----------
        entry : Entry
        stop : callable, optional
        max_depth : float, m, optional
            The largest depth of the scene's motion when left out.
        save : SaveAt, optional
        """
        once = dataclasses.replace(self.scene.motion, stages=(), times=(), depths=())
        if max_depth is not None:
            once = dataclasses.replace(once, max_depth=max_depth)
        return self.complete(self.insertion_run(entry, once), stop, save)

    def forget(self) -> None:
        """Start the next insertion without initial values from the last one."""
        self._warm_start = None

    def move(self, entry: Entry, save: SaveAt | None = None) -> Insertion:
        """Simulate the complete motion of the scene from an entry."""
        return self.complete(self.insertion_run(entry), save=save)

    def insertion_run(self, entry: Entry, motion: Motion | None = None) -> InsertionRun:
        """Return a motion of the needle that is ready to run.

        Parameters
        ----------
        entry : Entry
        motion : Motion, optional
            That of the scene when left out.
        """
        needle, motion = self.instrument(entry), motion or self.scene.motion
        warm_start = WarmStart(entry.point)
        if self._warm_start is not None:
            warm_start = self._warm_start.for_entry(entry.point, self.scene.needle.tip_radius)
        self._warm_start = warm_start
        friction = partial(self.friction, entry)
        return InsertionRun(
            self.scene,
            motion,
            needle,
            self._tissue_response(),
            self.model,
            friction=friction,
            warm_start=warm_start,
        )

    def _tissue_response(self) -> TissueResponse:
        """Return the response of the tissue; responses that depend on time are imported here."""
        if self.scene.discretization.integrator in DYNAMIC:
            from needlefem.insertion.response_in_time import dynamic_response  # noqa: PLC0415

            return dynamic_response(self.scene, self.model, self._expected_loads(1))
        if self._memory:
            from needlefem.insertion.response_in_time import ViscoelasticResponse  # noqa: PLC0415

            return ViscoelasticResponse(self.model, self._expected_loads(1))
        return ElasticResponse(self.responses)

    def complete(
        self,
        run: InsertionRun,
        stop: Stop | None = None,
        save: SaveAt | None = None,
        states: Iterator[State] | None = None,
    ) -> Insertion:
        """Run a motion to its end, or until `stop` returns True; see `insert`.

        `states` are those of the run, if they pass another reader first, such as `recorded_states`.
        """
        kept = KeptStates(save or SaveAt(), run)
        doing(f"insertion {self.insertions + 1}")
        expect_steps(run.expected_steps)
        for state in run.iterate() if states is None else states:
            kept.add(state)
            if self._watch is not None:
                self._watch(state)
            if stop is not None and stop(state):
                break
        self.insertions += 1
        expect_steps(0)
        return kept.insertion()


def simulate(scene: Scene, save: SaveAt | None = None) -> Insertion:
    """Simulate the motion of a scene. Parameters, result and errors: see `needlefem.simulate`."""
    simulation = Simulation(scene, expected_insertions=1)
    simulation.check()
    return simulation.move(simulation.entry_of_case(), save)


# Summary of the discretisation: element, mesh sizes, unknowns, path spacing.


@dataclasses.dataclass(frozen=True, kw_only=True)
class Discretised:
    """Summary of a discretization.

    Parameters
    ----------
    element : str
    cells, unknowns : int
    smallest_cell, largest_cell : float, m
        Cell sizes: side of the square, or leg of the right isosceles triangle, of the same area.
    cells_along_needle : float or None, m
        Size of the largest cell on the needle axis; None if the axis meets no cell.
    path_spacing : float, m
    tip_quadrature_points : int
        Quadrature points of the tip kernel.
    integrator : str
    """

    element: str
    cells: int
    unknowns: int
    smallest_cell: float
    largest_cell: float
    cells_along_needle: float | None
    path_spacing: float
    tip_quadrature_points: int
    integrator: str

    def __str__(self) -> str:
        sizes = f"{1e3 * self.smallest_cell:.3g} mm"
        largest = f"{1e3 * self.largest_cell:.3g} mm"
        if largest != sizes:
            sizes = f"{sizes} to {largest}"
        along = ""
        if self.cells_along_needle is not None:
            along = f" ({1e3 * self.cells_along_needle:.3g} mm along the needle)"
        return (
            f"{self.element}, {self.unknowns} unknowns, {self.cells} cells of "
            f"{sizes}{along}, "
            f"path spacing {1e3 * self.path_spacing:.3g} mm"
        )


def discretised(simulation: Simulation, entry: Entry) -> Discretised:
    """Return the summary of a simulation's discretization, with the cell size along a needle."""
    model, numbers = simulation.model, simulation.scene.discretization
    sizes, along = cell_sizes(model.mesh), sizes_along(simulation, entry)
    return Discretised(
        element=model.element.name,
        cells=model.mesh.nelements,
        unknowns=len(model.free_dofs),
        smallest_cell=float(np.min(sizes)),
        largest_cell=float(np.max(sizes)),
        cells_along_needle=float(along.max()) if along.size else None,
        path_spacing=numbers.path_spacing,
        tip_quadrature_points=numbers.tip_quadrature_points,
        integrator=numbers.integrator,
    )
