"""Strains of a state of an insertion, compared with the range of small strain."""

import dataclasses

import numpy as np

from needlefem._arrays import Floats
from needlefem.insertion.result import Insertion
from needlefem.insertion.state import displacements

LARGE_STRAIN = 0.3
"""Principal strain outside the kernel up to which small strain is trusted, where no case says."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class StrainCheck:
    """Strains of one state.

    Parameters
    ----------
    largest_strain : float
        Largest principal strain (absolute) outside the tip's kernel.
    smallest_volume_ratio : float
        Smallest ``det(I + grad u)`` outside the tip's kernel.
    inverted_cells : int
        Cells, the kernel's among them, that the displacement turns over.
    strain_limit : float
        That the case trusts small strain with.
    """

    largest_strain: float
    smallest_volume_ratio: float
    inverted_cells: int
    strain_limit: float = LARGE_STRAIN

    @property
    def beyond_limit(self) -> bool:
        """Whether strains are larger than what the model describes."""
        return self.largest_strain > self.strain_limit

    @property
    def headline(self) -> str:
        """What the first line of a result says of strains beyond the limit."""
        if self.beyond_limit:
            size = f"{self.largest_strain:.2g} > limit {self.strain_limit:g}"
            return f"strains beyond the model's range: yes ({size})"
        return f"strains beyond the model's range: no ({self.largest_strain:.2g})"

    def warnings(self) -> list[str]:
        """Return a sentence for everything that should not be believed."""
        found = []
        if self.beyond_limit:
            found.append(
                f"the largest strain away from the tip is {self.largest_strain:.2f}: "
                "beyond small strain, take displacements there as indicative"
            )
        if self.inverted_cells:
            found.append(f"{self.inverted_cells} mesh cells fold over: the state is not physical")
        return found


def validity(insertion: Insertion, state: int) -> StrainCheck:
    """Return the validity indicators of a state."""
    model, radius = insertion.model, insertion.scene.needle.tip_radius
    moved = displacements(insertion, [state])[:, 0]
    gradient: Floats = model.basis.interpolate(moved).grad  # (dim, dim, ncells, npoints)
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
