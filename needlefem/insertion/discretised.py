"""What a simulation is computed on: element, mesh sizes, unknowns, path spacing."""

import dataclasses

import numpy as np

from needlefem.checks.insertion_checks import sizes_along
from needlefem.insertion.simulation import Simulation
from needlefem.mesh.entry import Entry
from needlefem.mesh.generation import cell_sizes


@dataclasses.dataclass(frozen=True, kw_only=True)
class Discretised:
    """A discretisation in the numbers that say how fine it is.

    Parameters
    ----------
    element : str
    cells, unknowns : int
    smallest_cell, largest_cell : float, m
        Side of a square, or leg of a right isosceles triangle, of a cell's area.
    cells_along_needle : float or None, m
        Size of the largest cell on the needle's line; None if it meets none.
    path_spacing : float, m
    kernel_points : int
        Quadrature points of the tip's kernel.
    integrator : str
    """

    element: str
    cells: int
    unknowns: int
    smallest_cell: float
    largest_cell: float
    cells_along_needle: float | None
    path_spacing: float
    kernel_points: int
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
    """Return how fine a simulation's discretisation is, along a needle too."""
    model, numbers = simulation.model, simulation.scene.discretisation
    sizes, along = cell_sizes(model.mesh), sizes_along(simulation, entry)
    return Discretised(
        element=model.element.name,
        cells=model.mesh.nelements,
        unknowns=len(model.free_dofs),
        smallest_cell=float(np.min(sizes)),
        largest_cell=float(np.max(sizes)),
        cells_along_needle=float(along.max()) if along.size else None,
        path_spacing=numbers.path_spacing,
        kernel_points=numbers.kernel_points,
        integrator=numbers.integrator,
    )
