"""A scene made ready for insertions: tissue, responses, and the needle on any line."""

import dataclasses
from collections.abc import Callable, Mapping
from functools import cached_property

import numpy as np

from needlefem.arrays import Floats, Vector
from needlefem.errors import CaseError
from needlefem.fem.build import build_model
from needlefem.fem.columns import Corridor
from needlefem.fem.mesh import BACKGROUND
from needlefem.fem.model import Model
from needlefem.fem.responses import Responses
from needlefem.fem.skin import Entry, check_entry, entry_along, entry_at
from needlefem.insertion.course import Course
from needlefem.insertion.guide import Guide
from needlefem.insertion.media import ElasticMedium, Medium, responses_of
from needlefem.insertion.result import Insertion
from needlefem.insertion.state import State
from needlefem.materials import branches_of
from needlefem.needle.axis import Axis
from needlefem.needle.instrument import Instrument
from needlefem.needle.kernel import DiscKernel, Kernel, PointKernel, cross_section
from needlefem.resolve import Resolved, resolve
from needlefem.scene import DYNAMIC, Motion, Scene

Stop = Callable[[State], bool]
"""Says after every state whether the insertion may end."""
Watch = Callable[[State], None]
"""Sees every state, for progress."""


CORRIDOR = 2.0
"""Half-width of the corridor that needles are expected in, beside their heights, over the tip's
radius: the needle's own and as much for the bend of its path."""


class Simulation:
    """Everything that insertions in one scene share.

    Parameters
    ----------
    scene : Scene
        As read; it is resolved here.
    model : Model, optional
        The scene's discretised tissue, when it is there already.
    watch : callable, optional
        Called with every state of every insertion.

    Raises
    ------
    CaseError
        The scene can't be built.
    """

    def __init__(
        self, scene: Scene, model: Model | None = None, watch: Watch | None = None
    ) -> None:
        self._watch = watch
        self.resolved: Resolved = resolve(scene)
        self.scene = self.resolved.scene
        self.model = build_model(self.scene) if model is None else model
        self.direction: Vector = np.array(self.scene.motion.direction)
        self.insertions = 0
        self._guide: Guide | None = None
        laws = self.scene.materials.values()
        self._memory = any(branches_of(law, self.scene.dim, self.scene.plane) for law in laws)

    @property
    def reasons(self) -> dict[str, str]:
        """Why all is as it is, with what was found once there were responses."""
        found = dict(self.resolved.reasons)
        if "responses" in vars(self):
            unknowns, known = len(self.model.free_dofs), self.responses
            found["factorisation"] = f"{self.model.factor.name}: {unknowns} unknowns"
            spent = f"{known.size} rows, {known.solves} back-substitutions"
            found["responses"] = f"{known.way}: {spent}"
        return found

    @property
    def steps(self) -> bool:
        """Whether the scene's motion needs time steps, beyond what a march can do."""
        motion = self.scene.motion
        marched = self.scene.discretisation.integrator == "march"
        return not marched or bool(motion.stages or motion.times)

    @cached_property
    def responses(self) -> Responses:
        """Responses of the tissue, shared by all insertions."""
        return responses_of(self.model, corridor=self._corridor())

    def _corridor(self) -> Corridor | None:
        """Return where the scene's needles will be, if it says so."""
        scene, needle = self.scene, self.scene.needle
        point = scene.motion.entry or scene.target
        entry = (
            None if point is None else entry_along(self.model.mesh, np.array(point), self.direction)
        )
        if entry is None:
            return None
        aside = max(abs(height) for height in scene.planning.height_range)
        end = entry.point + scene.motion.max_depth * self.direction
        return Corridor(entry.point, end, CORRIDOR * needle.tip_radius + aside)

    @cached_property
    def cutting_force(self) -> Floats:
        """Nodal field of the cutting force, shape (nnodes,), N (N/m in 2D)."""
        own = {name: region.cutting_force for name, region in self.scene.regions.items()}
        return self._by_region(self.scene.needle.cutting_force, own)

    @cached_property
    def shaft_friction(self) -> Floats:
        """Nodal field of the friction limit, shape (nnodes,), N/m (Pa in 2D)."""
        own = {name: region.shaft_friction for name, region in self.scene.regions.items()}
        return self._by_region(self.scene.needle.shaft_friction, own)

    def _by_region(self, common: float, own: Mapping[str, float | None]) -> Floats:
        values = {name: common if value is None else value for name, value in own.items()}
        return self.model.per_node({BACKGROUND: common} | values)

    def entry_through(self, point: Vector) -> Entry:
        """Return where a needle that aims at a point enters the skin.

        Raises
        ------
        CaseError
            Its line misses the tissue, or the skin there is held or too oblique.
        """
        found = entry_along(self.model.mesh, point, self.direction)
        if found is None:
            problem = "a needle on the line through the target misses the tissue"
            raise CaseError("motion.direction", problem, "move the target or turn the needle")
        self._check(found)
        return found

    def entry_of_case(self) -> Entry:
        """Return the case's own entry, or that of the line through its target."""
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
        held = [mesh.boundaries[face] for face in sorted(faces)]
        for support in self.scene.supports.values():
            held += [mesh.t2f[:, mesh.subdomains[name]].ravel() for name in support.regions]
        facets = np.concatenate(held) if held else np.zeros(0, dtype=np.intp)
        check_entry(entry, self.direction, facets)

    def instrument(self, entry: Entry) -> Instrument:
        """Return the needle on the line that starts at an entry."""
        needle, numbers = self.scene.needle, self.scene.discretisation
        radius, points = needle.tip_radius, numbers.kernel_points
        kernel: Kernel = DiscKernel(radius, points, entry.point, entry.inward)
        section = cross_section(radius, points, self.model.dim)
        if needle.tip == "point":
            kernel, section = PointKernel(self.model.dim), cross_section(0.0, 1, self.model.dim)
        return Instrument(
            axis=Axis(entry.point, self.direction),
            kernel=kernel,
            interpolation=self.model.interpolation,
            cutting_force=self.cutting_force,
            shaft_friction=self.shaft_friction,
            section=section,
            lateral_stiffness=needle.lateral_stiffness,
            spacing=numbers.path_spacing,
        )

    def insert(self, entry: Entry, stop: Stop | None = None) -> Insertion:
        """Push the needle in at an entry, to the largest depth or until `stop` says so.

        Where a march nearby was the last, it begins with what that one learnt.
        """
        once = dataclasses.replace(self.scene.motion, stages=(), times=(), depths=())
        return self._run(self.course(entry, once), stop)

    def forget(self) -> None:
        """Begin the next march without what the last one learnt."""
        self._guide = None

    def move(self, entry: Entry) -> Insertion:
        """Let the needle do at an entry all that the scene's motion says."""
        return self._run(self.course(entry), None)

    def course(self, entry: Entry, motion: Motion | None = None) -> Course:
        """Return a motion of the needle, the scene's when left out, ready to run."""
        needle, motion = self.instrument(entry), motion or self.scene.motion
        guide = Guide(entry.point)
        if self._guide is not None:
            guide = self._guide.beside(entry.point, self.scene.needle.tip_radius)
        self._guide = guide
        return Course(self.scene, motion, needle, self._medium(), self.model, guide=guide)

    def _medium(self) -> Medium:
        """Return the tissue in time; what has inertia or a memory is imported with it."""
        if self.scene.discretisation.integrator in DYNAMIC:
            from needlefem.insertion.inertia import dynamic_medium  # noqa: PLC0415

            return dynamic_medium(self.scene, self.model)
        if self._memory:
            from needlefem.insertion.viscous import ViscoelasticMedium  # noqa: PLC0415

            return ViscoelasticMedium(self.model)
        return ElasticMedium(self.responses)

    def _run(self, course: Course, stop: Stop | None) -> Insertion:
        states = []
        for state in course.iterate():
            states.append(state)
            if self._watch is not None:
                self._watch(state)
            if stop is not None and stop(state):
                break
        self.insertions += 1
        return course.result(tuple(states))


def simulate(scene: Scene) -> Insertion:
    """Let the needle of a scene do what its motion says, at its entry.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Insertion
        With the path so far, and a status that says why, where the needle could not go on.

    Raises
    ------
    CaseError
        The scene can't be built, or its entry is missing or misses the skin.
    """
    simulation = Simulation(scene)
    return simulation.move(simulation.entry_of_case())
