"""What the needle touches, as linear functionals of the displacement."""

from typing import NamedTuple

from needlefem._arrays import Floats, Ints
from needlefem.fem.compliance import ComplianceColumns
from needlefem.fem.interpolation import LinearFunctionals


class ContactSegment(NamedTuple):
    """A functional of the displacement that belongs to the needle.

    Parameters
    ----------
    nodes : array, shape (k,)
    weights : array, shape (k,)
        The functional is ``sum_k weights[k] u[nodes[k]]``.
    offset : array, shape (dim - 1,), m
        Lateral offset from the axis of the material that it stands for, undeformed.
    compliance : float, m/N
        Of its lateral hold.
    """

    nodes: Ints
    weights: Floats
    offset: Floats
    compliance: float


class ContactTrial(NamedTuple):
    """Functionals tried beside the path, and the tissue's response to loads on them.

    Rows are functional-major: for each functional the axial, then the lateral components.

    Parameters
    ----------
    weights : LinearFunctionals
        The functionals.
    loads : array, shape (rows, n)
        Loads on touched dofs for unit forces on the functionals.
    rows : array, shape (n,)
        Rows that these dofs have among the responses.
    response : ComplianceColumns
        Displacement for these loads.
    bare : array, shape (rows, rows), m/N
        Response to unit forces with the path's lateral forces unchanged.
    coupling : array, shape (rows, path rows), m/N
        Response to unit forces on the path's pieces.
    half : array, shape (path laterals, rows)
        ``L^-1`` times the lateral part of the coupling, transposed.
    compliance : array, shape (rows, rows), m/N
        Response to unit forces when the path's lateral forces follow.
    displacement : array, shape (rows,), m
        Displacement without any force on the functionals tried.
    """

    weights: LinearFunctionals
    loads: Floats
    rows: Ints
    response: ComplianceColumns
    bare: Floats
    coupling: Floats
    half: Floats
    compliance: Floats
    displacement: Floats


class AxialCompliance(NamedTuple):
    """Axial displacement of the covered pieces when lateral forces follow.

    Parameters
    ----------
    compliance : array, shape (covered, covered), m/N
        Response to axial forces on them.
    displacement : array, shape (covered,), m
        Without axial forces.
    half : array, shape (covered laterals, covered)
        ``L^-1`` times the response of lateral to axial components.
    held : array, shape (covered laterals,)
        ``L^-1`` times what the lateral hold has to close without axial forces.
    """

    compliance: Floats
    displacement: Floats
    half: Floats
    held: Floats
