"""``needlefem figures``."""

import argparse
from pathlib import Path

from needlefem.alterovitz2003.figures import draw_figures
from needlefem.casefile.load import load_case
from needlefem.cli.common import named, say, say_json
from needlefem.io.result_folder import probe
from needlefem.plotting.backend import renderer


def main(options: argparse.Namespace) -> int:
    """Draw the paper's figures of a case and write their page; return the exit status."""
    renderer()  # before anything is simulated
    scene = load_case(options.case, options.overrides)
    folder = Path(named(options.out))
    page, pictures = folder / "figures.md", folder / "pictures"
    for path in (page, pictures / "figure-1.webp"):  # before anything is simulated
        probe(path)
    figures = draw_figures(scene, page, pictures)
    if options.json:
        rows = [
            {"figure": f.number, "quantity": name, "paper": paper, "here": here}
            for f in figures
            for name, paper, here in f.rows
        ]
        say_json({"case": scene.title, "page": str(page), "rows": rows})
    else:
        say(f"wrote {page} with {len(figures)} figures")
    return 0
