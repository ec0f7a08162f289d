"""Random scenes that are valid: every draw follows from a seed and a number.

A scene is drawn in a frame of its own, the first axis along the skin and the second into the
tissue, and then turned: by quarter turns for a box, by any angle for a mesh from a file.
"""

import itertools

import numpy as np

from needlefem._arrays import Floats, Points
from needlefem.elements import CATALOGUE
from needlefem.stress.drawncase import (
    MESH_UNIT,
    CaseTables,
    DrawnCase,
    DrawnMesh,
    DrawnQuantity,
    Section,
    draw_grid,
    draw_law,
    draw_motion,
    draw_time,
    grid_of_file,
)

Random = np.random.Generator

FACES = ("near", "far", "left", "right")
"""Faces in the scene's own frame: the skin, the opposite face, and the lateral faces."""
SYMMETRY_SHARE = 0.3
"""Share of the scenes whose symmetry is checked."""
PLAN_SHARE = 0.15
"""Share of the scenes with a plan."""


def length(value: float) -> DrawnQuantity:
    """Return a length, m."""
    return DrawnQuantity(float(value), "length")


def point(values: Floats) -> list[DrawnQuantity]:
    """Return a point of a case, m."""
    return [length(value) for value in values]


def chosen(random: Random, options: dict[str, float]) -> str:
    """Return a random word with weights."""
    weights = np.array(list(options.values()))
    return str(random.choice(list(options), p=weights / weights.sum()))


def power(random: Random, low: float, high: float) -> float:
    """Return a random number with a uniform decimal logarithm between two bounds."""
    return float(10.0 ** random.uniform(low, high))


def draw_case(seed: int, number: int) -> DrawnCase:
    """Return the scene with a given number."""
    return _Draw(np.random.default_rng([seed, number])).case()


class _Draw:
    """Data of a scene during its generation."""

    def __init__(self, random: Random) -> None:
        self.random = random
        self.kinds: dict[str, str] = {}
        self.data: CaseTables = {"schema_version": 2, "title": "random", "axes": ["y", "z"]}
        self.contours: dict[str, Points] = {}

    def kind(self, aspect: str, options: dict[str, float]) -> str:
        self.kinds[aspect] = chosen(self.random, options)
        return self.kinds[aspect]

    def case(self) -> DrawnCase:
        random, data = self.random, self.data
        command = self.kind("command", {"run": 1.0 - PLAN_SHARE, "plan": PLAN_SHARE})
        self.grid = draw_grid(random, self.kind("mesh", {"box": 0.65, "file": 0.35}))
        self.kinds["cells"] = self.grid.pattern
        self._line()
        self._frame()
        self._inclusions()
        data["tissue"] = {"default_material": "tissue"}
        self._element()
        self._materials()
        self._plane()
        self._needle()
        self._method(command)
        self._motion(command)
        mesh = self._mesh()
        self._supports()
        check = ""
        if random.random() < SYMMETRY_SHARE:
            check = chosen(random, {"mirror": 1.0, "rotation": 1.0, "scaling": 1.0})
            rollers = any("fixed" in support for support in data["supports"].values())
            if check == "rotation" and rollers:
                check = "mirror"
        self.kinds["symmetry"] = check or "none"
        return DrawnCase(
            data=data,
            contours=self.contours,
            mesh=mesh,
            kinds=self.kinds,
            command=command,
            check=check,
        )

    def _line(self) -> None:
        """Draw tip radius, direction, entry and depth in the scene's own frame."""
        random, grid = self.random, self.grid
        self.radius = grid.needle_size * random.uniform(0.45, 1.3)
        obliqueness = self.kind("direction", {"normal": 0.4, "oblique": 0.5, "very oblique": 0.1})
        low, high = {"normal": (0, 0), "oblique": (3, 40), "very oblique": (40, 60)}[obliqueness]
        angle = np.radians(random.uniform(low, high)) * random.choice([-1.0, 1.0])
        self.direction = np.array([np.sin(angle), np.cos(angle)])
        margin = 3.0 * self.radius + 0.06 * grid.width
        depth = random.uniform(0.3, 0.65) * grid.height / max(self.direction[1], 0.7)
        depth = min(depth, (grid.height - margin) / self.direction[1])
        free = grid.width - 2.0 * margin
        depth = min(depth, 0.98 * free / max(abs(self.direction[0]), 1e-9))
        self.depth = depth = max(depth, 4.0 * self.radius)
        aside = depth * self.direction[0]
        begin = margin + random.uniform(0.0, 1.0) * max(free - abs(aside), 0.0)
        begin += max(-aside, 0.0)
        if obliqueness == "normal" and random.random() < 0.3:
            begin = 0.5 * grid.width
            self.kinds["direction"] = "on the middle"
        self.entry = np.array([begin, 0.0])

    def _frame(self) -> None:
        """Draw position and orientation of the scene's own frame in space."""
        random = self.random
        if self.grid.from_file:
            angle = random.uniform(0.0, 2.0 * np.pi)
        else:
            quarter = int(random.choice(4, p=[0.55, 0.15, 0.15, 0.15]))
            angle = 0.5 * np.pi * quarter
        self.turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        if not self.grid.from_file:
            self.turn = np.round(self.turn)
        self.origin = np.zeros(2)
        if random.random() < 0.5:
            self.origin = self.grid.width * random.uniform(-1.0, 1.0, 2)

    def out(self, points: Floats) -> Floats:
        """Return points of the scene's own frame in space."""
        found: Floats = points @ self.turn.T + self.origin
        return found

    def _inclusions(self) -> None:
        """Draw contours with a distance from each other and from the faces."""
        random, grid = self.random, self.grid
        wanted = int(random.choice([0, 1, 2, 3], p=[0.3, 0.35, 0.2, 0.15]))
        self.inclusions: dict[str, Points] = {}
        circles: list[tuple[Floats, float]] = []
        for _ in range(20 * wanted):
            if len(circles) == wanted:
                break
            radius = random.uniform(0.09, 0.24) * min(grid.width, grid.height)
            radius = max(radius, 1.6 * grid.coarse_size)
            low, high = radius + 0.02 * grid.width, np.array([grid.width, grid.height]) - radius
            if np.any(high - 0.02 * grid.width <= low):
                continue
            centre = random.uniform(low, high - 0.02 * grid.width)
            apart = [np.linalg.norm(centre - c) - r - radius for c, r in circles]
            if apart and min(apart) < 0.5 * grid.coarse_size:
                continue
            circles.append((centre, radius))
            self.inclusions[f"part-{len(circles)}"] = centre + radius * _outline(random)
        self.kinds["inclusions"] = str(len(circles))

    def _element(self) -> None:
        shape = "quadrilateral" if self.grid.pattern == "quadrilateral" else "triangle"
        names = [row.name for row in CATALOGUE.values() if row.cell == shape]
        name = self.kind("element", {"auto": 0.25} | {n: 0.75 / len(names) for n in names})
        self.limit = 0.5 if name == "auto" else CATALOGUE[name].poissons_ratio_limit
        self.data["discretization"] = {"element": name}

    def _materials(self) -> None:
        random, data = self.random, self.data
        self.modulus = 1e3 * power(random, 0.0, 2.0)
        self.speed = power(random, -3.3, -1.7)
        laws = {"isotropic": 0.6, "transversely-isotropic": 0.12, "orthotropic": 0.1}
        law = self.kind("law", laws | {"viscoelastic": 0.18})
        duration = self.depth / self.speed
        data["materials"] = {"tissue": draw_law(random, law, self.modulus, self.limit, duration)}
        data["regions"] = {}
        for name, outline in self.inclusions.items():
            contrast = power(random, -1.0, 1.3)
            other = law if random.random() < 0.4 else "isotropic"
            data["materials"][name] = draw_law(
                random, other, contrast * self.modulus, self.limit, duration
            )
            region: Section = {"material": name}
            if self.grid.from_file and random.random() < 0.6:
                region["group"] = name
            else:
                self.contours[f"{name}.csv"] = self.out(outline)
                region["contour"] = f"{name}.csv"
            data["regions"][name] = region

    def _plane(self) -> None:
        """Draw plane strain or stress; a viscoelastic law needs plane strain."""
        laws = {table["law"] for table in self.data["materials"].values()}
        stress = 0.0 if "viscoelastic" in laws else 0.18
        if self.kind("plane", {"strain": 1.0 - stress, "stress": stress}) == "stress":
            self.data["tissue"]["plane"] = "stress"

    def _needle(self) -> None:
        random = self.random
        force = self.modulus * self.radius * power(random, -1.3, 0.1)
        friction = min(force / self.depth * power(random, -1.5, 1.0), self.modulus)
        if random.random() < 0.08:
            friction = 0.0
        stiffness = self.modulus / self.radius
        needle: Section = {
            "tip_radius": length(self.radius),
            "cutting_force": DrawnQuantity(force, "force per length"),
            "shaft_friction": DrawnQuantity(friction, "pressure"),
            "lateral_penalty": DrawnQuantity(
                stiffness * power(random, 1.3, 3.0), "force per volume"
            ),
        }
        law = {"kinetic": 0.62, "static with weakening": 0.25, "static": 0.05, "compliant": 0.08}
        kind = self.kind("friction", law)
        if kind.startswith("static"):
            needle["static_friction_ratio"] = float(random.uniform(1.03, 1.6))
        if kind == "static with weakening":
            needle["slip_weakening_distance"] = length(self.radius * power(random, -0.5, 1.0))
        if kind == "compliant" or (kind.startswith("static") and random.random() < 0.3):
            found = stiffness * power(random, 0.5, 2.5)
            needle["tangential_penalty"] = DrawnQuantity(found, "force per volume")
        self.data["needle"] = needle
        for region in self.data["regions"].values():
            if random.random() < 0.5:
                own = force * power(random, -0.5, 0.5)
                region["cutting_force"] = DrawnQuantity(own, "force per length")
            if random.random() < 0.5:
                own = friction * power(random, -0.5, 0.5)
                region["shaft_friction"] = DrawnQuantity(own, "pressure")

    def _method(self, command: str) -> None:
        random, data = self.random, self.data
        marched = self.kinds["law"] != "viscoelastic" and self.kinds["friction"] == "kinetic"
        options = {"auto": 0.5, "quasi_static": 0.25, "newmark": 0.07, "generalized_alpha": 0.1}
        if marched:
            options["path_following"] = 0.2
        if command == "plan":
            options = {"auto": 0.8, "quasi_static": 0.2}
        integrator = self.kind("integrator", options)
        found = data["discretization"]
        found["integrator"] = integrator
        share = random.uniform(0.75, 1.6)
        if "tangential_penalty" in data["needle"] and random.random() < 0.5:
            share = random.uniform(0.4, 0.75)
        found["path_spacing"] = length(max(share * self.grid.needle_size, self.depth / 30.0))
        if integrator in ("newmark", "generalized_alpha"):
            wave = np.sqrt(self.modulus / 3.0 / 1000.0)
            self.speed = wave * power(random, -2.3, -0.7)
            draw_time(random, data, integrator, self.depth / self.speed)

    def _motion(self, command: str) -> None:
        random, data = self.random, self.data
        motion: Section = {
            "direction": [float(x) for x in self.turn @ self.direction],
            "max_depth": length(self.depth),
            "speed": DrawnQuantity(self.speed, "speed"),
        }
        data["motion"] = motion
        if command == "plan":
            reached = random.uniform(0.45, 0.75) * self.depth
            data["target"] = {"point": point(self.out(self.entry + reached * self.direction))}
            reach = 0.6 * self.radius + 0.05 * self.depth
            data["planning"] = {
                "offset_range": [length(-reach), length(reach)],
                "tolerance": length(1e-7 * self.depth),
                "interval_tolerance": length(1e-2 * self.depth),
                "estimate": bool(random.random() < 0.3),
                "search": chosen(random, {"root": 0.85, "golden": 0.1, "grid": 0.05}),
            }
            self.kinds["motion"] = "plan"
            return
        motion["entry"] = point(self.out(self.entry))
        kinds = {"push": 0.38, "release": 0.2, "out and in": 0.12, "to and fro": 0.1}
        kind = self.kind("motion", kinds | {"train": 0.1, "table": 0.1})
        motion |= draw_motion(random, kind, self.depth, self.speed)

    def _mesh(self) -> DrawnMesh | None:
        random, grid, data = self.random, self.grid, self.data
        if grid.from_file:
            kind = self.kind("file", {"gmsh41": 0.4, "gmsh22": 0.3, "gmsh22-binary": 0.3})
            groups = {n: p for n, p in self.inclusions.items() if "group" in data["regions"][n]}
            mesh = grid_of_file(random, grid, groups, kind, self.out)
            data["mesh"] = {"file": "mesh.msh", "unit": length(MESH_UNIT)}
            data["mesh"]["cell"] = (
                "quadrilateral" if grid.pattern == "quadrilateral" else "triangle"
            )
            self.faces = {face: face for face in FACES}
            return mesh
        corners = self.out(np.array([[0.0, 0.0], [grid.width, grid.height]]))
        low, high = corners.min(axis=0), corners.max(axis=0)
        divisions = np.abs(self.turn) @ np.array(grid.divisions)
        data["mesh"] = {
            "size": point(high - low),
            "origin": point(low),
            "divisions": [round(float(n)) for n in divisions],
            "pattern": grid.pattern,
        }
        refine: dict[str, DrawnQuantity] = {}
        if self.inclusions and random.random() < 0.3 and self._roomy():
            data["mesh"]["interfaces"] = "fitted"
            refine["contour_size"] = length(0.3 * grid.coarse_size)
            self.kinds["mesh"] = "box, fitted"
        if grid.refined:
            refine["corridor_size"] = length(grid.needle_size)
            refine["corridor_width"] = length(5.0 * self.radius)
            self.kinds["mesh"] += ", refined"
        if refine:
            data["mesh"]["refine"] = refine
        self.faces = _faces_of_box(self.turn)
        return None

    def _roomy(self) -> bool:
        """Return whether the mesh can be fitted: gaps of at least one cell around contours."""
        room, grid = self.grid.coarse_size, self.grid
        outlines = list(self.inclusions.values())
        high = np.array([grid.width, grid.height]) - room
        if any(np.any((outline < room) | (outline > high)) for outline in outlines):
            return False
        pairs = itertools.combinations(outlines, 2)
        return all(
            np.linalg.norm(one[:, None] - other, axis=2).min() > room for one, other in pairs
        )

    def _supports(self) -> None:
        random, faces = self.random, self.faces
        kind = self.kind(
            "supports",
            {"three": 0.4, "far": 0.2, "sides": 0.15, "far and a side": 0.15, "rollers": 0.1},
        )
        if kind == "rollers" and self.grid.from_file:
            kind = self.kinds["supports"] = "far"
        held = {
            "three": ["far", "left", "right"],
            "far": ["far"],
            "sides": ["left", "right"],
            "far and a side": ["far", str(random.choice(["left", "right"]))],
            "rollers": ["far"],
        }[kind]
        supports: dict[str, Section] = {"held": {"faces": [faces[face] for face in held]}}
        if kind == "rollers":
            across = "y" if abs(self.turn[0, 0]) > 0.5 else "z"
            sides = [faces["left"], faces["right"]]
            supports["rollers"] = {"faces": sides, "fixed": [across]}
        self.data["supports"] = supports


def _outline(random: Random) -> Points:
    """Return a closed outline within the unit circle: an ellipse, a polygon or a wavy circle."""
    kind = chosen(random, {"ellipse": 0.5, "polygon": 0.25, "waves": 0.25})
    count = int(random.integers(5, 9)) if kind == "polygon" else int(random.integers(24, 60))
    turn = 2.0 * np.pi * (np.arange(count) + random.uniform(0.0, 1.0)) / count
    radius = np.ones(count)
    if kind == "waves":
        radius = 0.87 + 0.13 * np.cos(int(random.integers(2, 5)) * turn)
    flat = random.uniform(0.75, 1.0) if kind == "ellipse" else 1.0
    return np.stack([radius * np.cos(turn), flat * radius * np.sin(turn)], axis=1)


def _faces_of_box(turn: Floats) -> dict[str, str]:
    """Return the names of the box's faces for the faces of the scene's own frame."""
    outward = {"near": (0, -1), "far": (0, 1), "left": (-1, 0), "right": (1, 0)}
    names = {(-1, 0): "y_min", (1, 0): "y_max", (0, -1): "z_min", (0, 1): "z_max"}
    found = {}
    for face, normal in outward.items():
        y, z = np.round(turn @ np.array(normal)).astype(int).tolist()
        found[face] = names[y, z]
    return found
