"""The energy ledger of the case's insertion by two formulas."""

from needlefem.insertion import Simulation, energy_terms
from needlefem.scene import Scene, vary
from needlefem.studies import Table

IDENTITY, CONSISTENT, TRAPEZOIDAL = 1e-10, 1e-6, 2e-2
"""Largest mismatch of strain energy, and of the ledger by either formula, of the work."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return residuals for three path spacings."""
    del other
    rows: list[list[object]] = []
    for factor in (1.0, 0.5, 0.25):
        spacing = factor * scene.discretization.path_spacing
        simulation = Simulation(vary(scene, {"discretization.path_spacing": spacing}))
        insertion = simulation.insert(simulation.entry_of_case())
        consistent, trapezoidal = energy_terms(insertion), energy_terms(insertion, trapezoidal=True)
        holds = (
            consistent.strain_energy_mismatch <= IDENTITY
            and consistent.residual <= CONSISTENT
            and trapezoidal.residual <= TRAPEZOIDAL
        )
        residuals = (consistent.strain_energy_mismatch, consistent.residual, trapezoidal.residual)
        rows.append([1e3 * spacing, consistent.work, *residuals, holds])
    return [
        Table(
            title="energy balance of the case's insertion, relative to the work on the needle",
            columns=(
                "path spacing (mm)",
                "work (J/m)",
                "strain energy mismatch",
                "residual, consistent",
                "residual, trapezoidal",
                "passed",
            ),
            rows=rows,
            passed=all(bool(row[5]) for row in rows),
        )
    ]
