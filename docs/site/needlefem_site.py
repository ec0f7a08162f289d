"""What the documentation site adds to Sphinx: pictures of the gallery, the verification report."""

import json
import shutil
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.errors import ConfigError
from sphinx_gallery.scrapers import figure_rst

ROOT = Path(__file__).parents[2]
REPORT = ROOT / "out" / "docs-verification" / "verification.json"
REPORT_PAGE = "docs/verification-report"
GALLERY = "docs/gallery"

_shown: dict[Path, float] = {}
"""Pictures that were there before, and when they were written."""


def _pictures() -> dict[Path, float]:
    files = sorted((ROOT / GALLERY / "out").glob("*.png"))
    return {file: file.stat().st_mtime for file in files}


def pictures(_block: Any, variables: dict[str, Any], settings: dict[str, Any]) -> str:
    """Return what shows the pictures that a block of a gallery script wrote into ``out``."""
    names = []
    for file, written in _pictures().items():
        if _shown.get(file) != written:
            names.append(next(variables["image_path_iterator"]))
            shutil.copyfile(file, names[-1])
    _shown.update(_pictures())
    return figure_rst(names, settings["src_dir"]) if names else ""


def forget_pictures(_settings: dict[str, Any], _name: str | None) -> None:
    """Take what is there for shown, before a script runs."""
    _shown.update(_pictures())


def adapt(_app: Sphinx, page: str, text: list[str]) -> None:
    """Add the latest verification to its report; lead from the gallery's source to its pages."""
    if page == REPORT_PAGE:
        text[0] += "\n" + _report()
    text[0] = text[0].replace("gallery/GALLERY_HEADER.rst", "examples/index.rst")


def outdated(*_: Any) -> list[str]:
    """Return the page that changes with each verification."""
    return [REPORT_PAGE]


def _report() -> str:
    if not REPORT.exists():
        raise ConfigError(f"no '{REPORT}': `make docs` runs the verification first")
    report = json.loads(REPORT.read_text(encoding="utf-8"))
    answers = [answer for problem in report["problems"] for answer in problem["answers"]]
    missed = sum(not a["reference_met"] or a["record_met"] is False for a in answers)
    packages = ", ".join(f"{name} {number}" for name, number in report["packages"].items())
    kind = "quick run" if report["quick"] else "complete run"
    return "\n".join(
        [
            f"This site was built after a {kind} of {len(report['problems'])} problems with "
            f"{packages}: {len(answers)} quantities, {missed or 'none'} outside the tolerance. "
            '<a href="../verification.html">Errors against unknowns and time, with meshes</a>.',
            "",
            "| problem | requirement | reference | quantities | outside tolerance |",
            "|---|---|---|---|---|",
            *map(_row, report["problems"]),
            "",
        ]
    )


def _row(problem: dict[str, Any]) -> str:
    missed = [a for a in problem["answers"] if not a["reference_met"] or a["record_met"] is False]
    cells = [problem["name"], problem["requirement"], problem["reference"]]
    cells += [str(len(problem["answers"])), str(len(missed) or "none")]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx what is here."""
    app.connect("source-read", adapt)
    app.connect("env-get-outdated", outdated)
    return {"parallel_read_safe": True}
