"""Strains in a state of an insertion, compared with the range of small strain."""

import dataclasses

import numpy as np

from needlefem._arrays import Floats
from needlefem.insertion.result import Insertion
from needlefem.insertion.state import displacements

LARGE_STRAIN = 0.3
"""Default limit of the principal strain outside the tip kernel."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class StrainCheck:
    """Strains in one state.

    Parameters
    ----------
    largest_strain : float
        Largest absolute principal strain outside the tip kernel.
    smallest_volume_ratio : float
        Smallest ``det(I + grad u)`` outside the tip kernel.
    inverted_cells : int
        Number of cells, including those in the tip kernel, with ``det(I + grad u) <= 0``.
    strain_limit : float
        Largest strain for which the case accepts small-strain results.
    """

    largest_strain: float
    smallest_volume_ratio: float
    inverted_cells: int
    strain_limit: float = LARGE_STRAIN

    @property
    def beyond_limit(self) -> bool:
        """Whether the largest strain exceeds the limit."""
        return self.largest_strain > self.strain_limit

    @property
    def headline(self) -> str:
        """Sentence on the strain limit for the first line of a result."""
        if self.beyond_limit:
            size = f"{self.largest_strain:.2g} > limit {self.strain_limit:g}"
            return f"strains beyond the model's range: yes ({size})"
        return f"strains beyond the model's range: no ({self.largest_strain:.2g})"

    def warnings(self) -> list[str]:
        """Return a sentence for each result that is not reliable."""
        found = []
        if self.beyond_limit:
            found.append(
                f"the largest strain away from the tip is {self.largest_strain:.2f}: "
                "beyond small strain, displacements there are only indicative"
            )
        if self.inverted_cells:
            found.append(
                f"{self.inverted_cells} mesh cells are inverted: the state is not physical"
            )
        return found


def validity(insertion: Insertion, state: int) -> StrainCheck:
    """Return the strain check of a state."""
    model, radius = insertion.model, insertion.scene.needle.tip_radius
    displacement = displacements(insertion, [state])[:, 0]
    gradient: Floats = model.basis.interpolate(displacement).grad  # (dim, dim, ncells, npoints)
    gradient = np.moveaxis(gradient, (0, 1), (2, 3))
    volume = np.linalg.det(np.eye(model.dim) + gradient)
    strain = np.linalg.eigvalsh(0.5 * (gradient + np.swapaxes(gradient, 2, 3)))
    where = np.moveaxis(np.asarray(model.basis.global_coordinates()), 0, 2)
    away = np.linalg.norm(where - insertion.states[state].tip, axis=2) > radius
    return StrainCheck(
        largest_strain=float(np.max(np.abs(strain[away]))),
        smallest_volume_ratio=float(np.min(volume[away])),
        inverted_cells=int(np.count_nonzero(np.min(volume, axis=1) <= 0.0)),
        strain_limit=insertion.scene.outputs.strain_limit,
    )
