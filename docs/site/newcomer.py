"""Do what README and docs tell a newcomer, in a folder that has the cases alone: `make newcomer`.

It is run by the Python of an environment into which the package was installed as a wheel.
"""

import os
import shutil
import sys
from pathlib import Path

import pages

import needlefem

PAGES = [
    *sorted((pages.ROOT / "docs" / "tutorial").glob("*.md")),
    *sorted((pages.ROOT / "docs" / "how-to").glob("*.md")),
]
PLAN = "needlefem plan cases/prostate-2003/case.toml --out out/prostate-2003"
PICTURE = "needlefem render cases/prostate-train/case.toml --out train.png"


def main(folder: str) -> None:
    """Plan and draw as in the README, then run every tutorial and how-to page."""
    if Path(needlefem.__file__).is_relative_to(pages.ROOT / "needlefem"):
        raise SystemExit("this is the source: install the package into an environment of its own")
    home = Path(folder).resolve()
    shutil.copytree(pages.ROOT / "cases", home / "readme" / "cases")
    os.chdir(home / "readme")
    for line in ("needlefem info", PLAN, PICTURE):
        pages.run(line.split(), False)
    for page in PAGES:
        sys.stdout.write(f"\n== {page.name}\n")
        here = home / page.stem / page.parent.name
        here.mkdir(parents=True)
        shutil.copytree(pages.ROOT / "cases", here / "cases")
        os.chdir(here)
        pages.run_page(page, pages.run)


if __name__ == "__main__":
    main(*sys.argv[1:])
