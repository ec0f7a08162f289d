"""Write the layers' contours: rectangles across the whole width."""

from pathlib import Path

WIDTH = 6.0
SKIN, FAT = (0.0, 0.2), (0.2, 1.6)


def layer(top: float, bottom: float) -> str:
    """Return a layer's outline as CSV, cm."""
    corners = [(0.0, top), (WIDTH, top), (WIDTH, bottom), (0.0, bottom)]
    lines = [f"{y:.5f}, {z:.5f}" for y, z in corners]
    return "\n".join(["y [cm], z [cm]", *lines]) + "\n"


FILES = {"skin.csv": layer(*SKIN), "fat.csv": layer(*FAT)}

if __name__ == "__main__":
    for name, text in FILES.items():
        (Path(__file__).parent / name).write_text(text, encoding="utf-8")
