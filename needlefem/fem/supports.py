"""Supports: displacement components that are held at zero on faces and in regions."""

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from needlefem._arrays import Ints
from needlefem._parameter import parameter
from needlefem.errors import CaseError, nearest, short
from needlefem.validation import Validated

if TYPE_CHECKING:  # a scene names its supports without the machinery of finite elements
    from needlefem.fem.function_space import FunctionSpace


@dataclasses.dataclass(frozen=True, kw_only=True)
class Support(Validated):
    """Faces and regions in which displacement components are held at zero."""

    TABLE = "supports.NAME"

    faces: tuple[str, ...] = parameter("Named faces of the mesh", default=())
    regions: tuple[str, ...] = parameter("Regions held as a whole, such as bone", default=())
    fixed: tuple[str, ...] = parameter(
        "Axes whose displacement is held; all when left out", default=()
    )


def supported_dofs(
    space: "FunctionSpace", supports: Mapping[str, Support], axes: tuple[str, ...]
) -> Ints:
    """Return the dofs that supports hold, rising.

    Parameters
    ----------
    space : FunctionSpace
    supports : mapping
        By their names in the case.
    axes : tuple of str
        Names of the axes.

    Raises
    ------
    CaseError
        A face or axis that doesn't exist.
    """
    held = [np.zeros(0, dtype=np.intp)]
    for name, support in supports.items():
        for axis in set(support.fixed) - set(axes):
            raise CaseError(f"supports.{name}.fixed", f"no axis {short(axis)}", nearest(axis, axes))
        components = [axes.index(axis) for axis in support.fixed or axes]
        for region in support.regions:
            nodes = np.unique(space.cell_nodes[space.mesh.subdomains[region]])
            held.append(space.node_dofs[nodes][:, components].ravel())
        for face in support.faces:
            facets = space.face(face, f"supports.{name}.faces")
            held.append(space.dofs_on(facets, components))
    return np.unique(np.concatenate(held))
