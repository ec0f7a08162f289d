"""Tissue on a canvas: its mesh by region or by values, edges and skin, moved by displacements."""

from typing import Any

import numpy as np

from needlefem._arrays import Floats, Ints, Points
from needlefem.fem.function_space import FunctionSpace
from needlefem.mesh.generation import BACKGROUND
from needlefem.plotting.backend import renderer
from needlefem.plotting.canvas import Canvas
from needlefem.plotting.surface import SurfaceMesh

EDGE_LAYER, SKIN_LAYER = 1, 2


class Body:
    """A mesh, drawn once and moved from displacement to displacement.

    Parameters
    ----------
    canvas : Canvas
    space : FunctionSpace
        Of plane tissue or of tissue in space.

    Attributes
    ----------
    data : pyvista.PolyData
        What is seen of it, to be coloured before it is drawn.
    surface : SurfaceMesh
    """

    def __init__(self, canvas: Canvas, space: FunctionSpace) -> None:
        self.canvas, self.space = canvas, space
        self.surface = SurfaceMesh(space, canvas.behind(space.mesh))
        self.data = canvas.polygons(self.surface.rest, self.surface.polygons)
        self._strands = []
        if space.dim == 2:
            self._strands.append(self._lines(self.surface.outline, SKIN_LAYER))

    def _lines(self, numbers: Ints, layer: float) -> Any:
        style, skin = self.canvas.style, layer == SKIN_LAYER
        width = style.outline_width if skin else style.mesh_width
        lines = self.canvas.strands(self.surface.rest, numbers, layer, width)
        return lines.draw(style.outline if skin else style.mesh, closed=skin)

    def draw(self, *, edges: bool = True, **how: Any) -> None:
        """Draw it as PyVista is told."""
        straight = self.surface.parts == 1
        if edges and not straight:
            self._strands.append(self._lines(self.surface.edges, EDGE_LAYER))
        lines = self.canvas.edges() if edges and straight else {"show_edges": False}
        self.canvas.add(self.data, **lines, **how)

    def draw_regions(self) -> None:
        """Draw it in the colours of its regions."""
        mesh, palette = self.space.mesh, self.canvas.style.tissue
        names = [BACKGROUND, *sorted(set(mesh.subdomains) - {BACKGROUND})]
        owner = np.zeros(mesh.nelements, dtype=np.intp)
        for number, name in enumerate(names):
            owner[mesh.subdomains[name]] = number
        colours = np.array([renderer().Color(c).int_rgb for c in palette], dtype=np.uint8)
        self.data.cell_data["colours"] = colours[owner[self.surface.cells] % len(palette)]
        self.draw(scalars="colours", rgb=True)

    def to(self, u: Floats) -> Points:
        """Move it by a displacement, shape (ndofs,), m; return that of its points."""
        moved = self.surface.displaced(u)
        at = self.surface.rest + moved
        self.data.points = self.canvas.screen(at)
        for strands in self._strands:
            strands.to(at)
        return moved
