"""Write the contours of glandular tissue and tumour: wavy ellipses, cm."""

import math
from pathlib import Path


def blob(
    centre: tuple[float, float], radii: tuple[float, float], wave: tuple[int, float], count: int
) -> str:
    """Return a closed outline as CSV: an ellipse whose radius waves a number of times around."""
    times, share = wave
    lines = ["y [cm], z [cm]"]
    for number in range(count):
        turn = 2.0 * math.pi * number / count
        stretch = 1.0 + share * math.cos(times * turn)
        y = centre[0] + radii[0] * stretch * math.cos(turn)
        z = centre[1] + radii[1] * stretch * math.sin(turn)
        lines.append(f"{y:.5f}, {z:.5f}")
    return "\n".join(lines) + "\n"


FILES = {
    "gland.csv": blob((2.9, 5.2), (2.0, 2.5), (5, 0.08), 120),
    "tumour.csv": blob((2.3, 4.6), (0.6, 0.6), (7, 0.06), 56),
}

if __name__ == "__main__":
    for name, text in FILES.items():
        (Path(__file__).parent / name).write_text(text, encoding="utf-8")
