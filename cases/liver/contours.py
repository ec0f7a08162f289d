"""Write the contours of the liver, the tumour and two ribs: ellipses, cut flat where asked, cm."""

import math
from pathlib import Path


def ellipse(centre: tuple[float, float], radii: tuple[float, float], count: int) -> str:
    """Return an ellipse as CSV."""
    lines = ["y [cm], z [cm]"]
    for number in range(count):
        turn = 2.0 * math.pi * number / count
        y, z = centre[0] + radii[0] * math.cos(turn), centre[1] + radii[1] * math.sin(turn)
        lines.append(f"{y:.5f}, {z:.5f}")
    return "\n".join(lines) + "\n"


FILES = {
    "liver.csv": ellipse((5.2, 5.6), (4.2, 2.7), 96),
    "tumour.csv": ellipse((5.3, 4.8), (0.8, 0.8), 48),
    "rib-5.csv": ellipse((2.3, 1.7), (0.75, 0.4), 48),
    "rib-6.csv": ellipse((5.3, 1.7), (0.75, 0.4), 48),
}

if __name__ == "__main__":
    for name, text in FILES.items():
        (Path(__file__).parent / name).write_text(text, encoding="utf-8")
