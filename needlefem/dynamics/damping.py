"""Rayleigh damping."""

import dataclasses

import numpy as np

from needlefem.errors import CaseError


@dataclasses.dataclass(frozen=True, kw_only=True)
class Damping:
    """Rayleigh damping ``C = mass_rate M + stiffness_time K``, in 1/s and s."""

    mass_rate: float = 0.0
    stiffness_time: float = 0.0

    @classmethod
    def from_ratios(
        cls, frequencies: tuple[float, float], ratios: tuple[float, float]
    ) -> "Damping":
        """Return the damping that has two ratios at two frequencies (Hz).

        ``zeta = mass_rate / (2 w) + stiffness_time w / 2`` (Lord Rayleigh 1877).
        """
        first, second = (2.0 * np.pi * f for f in frequencies)
        if not first > 0.0 or first == second:
            raise CaseError("damping", f"frequencies {frequencies}", "give two different ones")
        matrix = 0.5 * np.array([[1.0 / first, first], [1.0 / second, second]])
        rate, time = np.linalg.solve(matrix, np.array(ratios))
        return cls(mass_rate=float(rate), stiffness_time=float(time))

    def ratio(self, frequency: float) -> float:
        """Return the share of critical damping at a frequency, Hz."""
        omega = 2.0 * np.pi * frequency
        return 0.5 * (self.mass_rate / omega + self.stiffness_time * omega)
