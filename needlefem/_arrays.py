"""Types of arrays, sparse matrices and meshes in signatures."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, overload

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.intp]
Bools = NDArray[np.bool_]
Points = Floats
"""Points as rows, shape (n, dim), m."""
Vector = Floats
"""A vector, shape (dim,)."""
_Index = Ints | Bools | slice

if TYPE_CHECKING:

    class Sparse(Protocol):
        """A sparse matrix of scipy: what is used of its interface (scipy ships no types).

        Only matrices in compressed formats (`tocsr`, `tocsc`) have `indices` and `indptr` and can
        be indexed.
        """

        shape: tuple[int, int]
        nnz: int
        data: Floats
        indices: Ints
        indptr: Ints
        T: "Sparse"

        def tocsr(self) -> "Sparse":
            """Return the matrix with compressed rows."""
            ...

        def tocsc(self) -> "Sparse":
            """Return the matrix with compressed columns."""
            ...

        def toarray(self, order: str = "C") -> Floats:
            """Return the dense array."""
            ...

        def diagonal(self) -> Floats:
            """Return the diagonal, shape (n,)."""
            ...

        def eliminate_zeros(self) -> None:
            """Remove the entries that are zero."""
            ...

        @overload
        def sum(self) -> float: ...

        @overload
        def sum(self, axis: int) -> Floats: ...

        @overload
        def __matmul__(self, other: Floats) -> Floats: ...

        @overload
        def __matmul__(self, other: "Sparse") -> "Sparse": ...

        def __add__(self, other: "Sparse | int") -> "Sparse": ...

        def __radd__(self, other: int) -> "Sparse": ...

        def __sub__(self, other: "Sparse") -> "Sparse": ...

        def __neg__(self) -> "Sparse": ...

        def __mul__(self, factor: float) -> "Sparse": ...

        def __rmul__(self, factor: float) -> "Sparse": ...

        def __getitem__(self, index: _Index | tuple[_Index, _Index]) -> "Sparse": ...

    class ReferenceCell(Protocol):
        """A reference cell of scikit-fem: corners, shape (dim, n), and corners of its facets."""

        p: Floats
        facets: Sequence[Sequence[int]]

    class SkfemElement(Protocol):
        """An element of scikit-fem with scalar shape functions; nodes have the shape (n, dim)."""

        doflocs: Floats
        maxdeg: int
        refdom: ReferenceCell

        def lbasis(self, X: Floats, i: int, /) -> tuple[Floats, Floats]:  # noqa: N803
            """Return shape function `i` and its gradient at reference points, shape (dim, n)."""
            ...

    class SkfemElementClass(Protocol):
        """The class of an element of scikit-fem."""

        refdom: ReferenceCell

        def __call__(self) -> SkfemElement: ...

        def __hash__(self) -> int: ...

    class SkfemDofs(Protocol):
        """Numbers of the degrees of freedom of every cell, in columns."""

        element_dofs: Ints

    class SkfemMesh(Protocol):
        """A mesh of scikit-fem: the part of its interface that is used here (it ships no types).

        Attributes
        ----------
        doflocs, p : array, shape (dim, n), m
            Nodes and vertices, in columns.
        t : array, shape (corners, ncells)
            Vertices of each cell, in columns.
        facets : array, shape (dim, nfacets)
            Vertices of each facet.
        t2f : array, shape (corners, ncells)
            Facets of each cell.
        f2t : array, shape (2, nfacets)
            Cells at each facet; -1 beyond the boundary.
        boundaries, subdomains : mapping or None
            Facets and cells of named groups.
        affine : bool
            Whether the map of each cell from the reference cell is affine.
        elem : SkfemElementClass
            Class of the element that maps the reference cell to a cell.
        bndelem : SkfemElement
            Element that maps a reference facet to a facet.
        dofs : SkfemDofs
            Degrees of freedom of `elem`: the columns of `doflocs`.
        """

        __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]
        doflocs: Floats
        p: Floats
        t: Ints
        facets: Ints
        t2f: Ints
        f2t: Ints
        nelements: int
        nvertices: int
        nfacets: int
        boundaries: Mapping[str, Ints] | None
        subdomains: Mapping[str, Ints] | None
        affine: bool
        elem: SkfemElementClass
        bndelem: SkfemElement
        dofs: SkfemDofs
        _cached_mapping: object

        def __init__(
            self,
            doflocs: Floats,
            t: Ints,
            _boundaries: Mapping[str, Ints] | None = None,
            _subdomains: Mapping[str, Ints] | None = None,
        ) -> None: ...

        def dim(self) -> int:
            """Return the number of space dimensions."""
            ...

        def boundary_facets(self) -> Ints:
            """Return the facets on the boundary."""
            ...

        def boundary_nodes(self) -> Ints:
            """Return the vertices on the boundary."""
            ...

        def refined(self, cells: Ints | int = 1, /) -> "SkfemMesh":
            """Return the mesh with some cells refined, or with all of them refined a few times."""
            ...

        def with_boundaries(self, boundaries: Mapping[str, Ints], /) -> "SkfemMesh":
            """Return the mesh with further named facets."""
            ...

        def with_subdomains(self, subdomains: Mapping[str, Ints], /) -> "SkfemMesh":
            """Return the mesh with further named cells."""
            ...

else:  # at run time the names are needed in annotations only; protocols cost time at the start
    Sparse = ReferenceCell = SkfemElement = SkfemElementClass = SkfemDofs = SkfemMesh = object


def enlarged(array: Floats, rows: int, columns: int) -> Floats:
    """Return an array with at least as many rows and columns; its size is doubled if needed."""
    have = array.shape
    if have[0] >= rows and have[1] >= columns:
        return array
    shape = tuple(
        h if h >= n else max(2 * n, 64) for h, n in zip(have, (rows, columns), strict=True)
    )
    grown = np.zeros(shape)
    grown[: have[0], : have[1]] = array
    return grown
