"""Axial forces of needle and tissue on each other in one step: what sticks and what slips.

Unknowns are the friction force on every covered piece, on the piece that the tip is in, and the
axial force of the tip. Lateral forces follow and are eliminated. With friction between its
limits, and the tip's force between nothing and that of cutting, the forces minimise a convex
potential under bounds (`boxed`), and the gradient is how far the needle slips.
"""

import dataclasses

import numpy as np

from needlefem._arrays import Floats
from needlefem.contact.condensed_contact import CondensedContact
from needlefem.contact.functionals import AxialCompliance, ContactTrial


# Kernel: axial equations of shaft and tip with all lateral forces eliminated.
#     u_e = u_0 + S z
# u_e     axial displacement of the segments and of the tip's kernel, m
# u_0     the same without axial forces, m
# S       W_ee - W_en (W_nn + D)^-1 W_ne, m/N (m^2/N in 2D)
# z       axial forces on the segments and on the tip, N (N/m in 2D)
# Source: static condensation, R. J. Guyan, AIAA Journal 3 (1965) 380; docs/theory.md, (8), (10).
@dataclasses.dataclass(frozen=True, eq=False)
class ShaftEquations:
    """Axial displacements as affine functions of axial forces, ``u = free + compliance z``.

    Rows and forces `z` are those of the covered pieces, of the piece that the tip is in, and of
    the tip. The trial's functionals are the tip's kernel (first) and that piece (second).

    Parameters
    ----------
    trial : ContactTrial
    sliding : AxialCompliance
        Of the covered pieces.
    compliance : array, shape (n, n), m/N
    free : array, shape (n,), m
    hold : array, shape (dim - 1, n + 1), N/N and N
        Lateral force on the tip's piece: part per unit of axial forces, and constant part.
    sideways : array, shape (dim - 1, n + 1), m/N and m
        Lateral displacement of the tip's kernel, in the same way.
    """

    trial: ContactTrial
    sliding: AxialCompliance
    compliance: Floats
    free: Floats
    lateral_force_map: Floats
    lateral_displacement_map: Floats

    @classmethod
    def build(
        cls,
        contact: CondensedContact,
        sliding: AxialCompliance,
        trial: ContactTrial,
        offset: Floats,
        stiffness: float,
    ) -> "ShaftEquations":
        """Eliminate all lateral forces.

        Parameters
        ----------
        contact : CondensedContact
        sliding : AxialCompliance
            As `contact.sliding()` gives it now.
        trial : ContactTrial
            Tried against the same path.
        offset : array, shape (dim - 1,), m
            Lateral offset from the axis of the material of the tip's piece, undeformed.
        stiffness : float, N/m
            Of its lateral hold.
        """
        dim, count = contact.dim, contact.covered
        cross = trial.coupling[:, ::dim] - trial.half.T @ sliding.half
        bare = trial.half.T @ sliding.held
        if contact.background is not None:
            bare = bare + (trial.weights.of(contact.background) @ contact.frame.T).ravel()
        axial, end = [dim, 0], slice(dim + 1, 2 * dim)
        columns = np.hstack([cross, trial.compliance[:, axial]])  # of the trial's rows
        compliance = np.zeros((count + 2, count + 2))
        compliance[:count, :count] = sliding.compliance
        compliance[:count, count:] = cross[axial].T
        compliance[count:] = columns[axial]
        free = np.concatenate([sliding.displacement, bare[axial]])
        # the piece's lateral force, and what it does to all others
        spring = np.eye(dim - 1) + stiffness * trial.compliance[end, end]
        rhs = np.column_stack([columns[end], offset + bare[end]])
        hold: Floats = -stiffness * np.linalg.solve(spring, rhs).astype(float)
        back = columns[end].T
        sideways = np.column_stack([columns[1:dim], bare[1:dim]])
        sideways += trial.compliance[1:dim, end] @ hold
        compliance += back @ hold[:, :-1]
        return cls(trial, sliding, 0.5 * (compliance + compliance.T), free + back @ hold[:, -1],
                   hold, sideways)  # fmt: skip

    def lateral(self, forces: Floats) -> Floats:
        """Return the lateral force on the tip's piece, shape (dim - 1,), N (N/m in 2D)."""
        return _affine(self.lateral_force_map, forces)

    def lateral_tip_displacement(self, forces: Floats) -> Floats:
        """Return the lateral displacement of the tip's kernel, shape (dim - 1,), m."""
        return _affine(self.lateral_displacement_map, forces)


def _affine(part: Floats, forces: Floats) -> Floats:
    found: Floats = part[:, :-1] @ forces + part[:, -1]
    return found
