"""All figures of the paper, and a page that shows each beside its numbers."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from needlefem.alterovitz2003.figures_targets import draw_moved_target, draw_targets_hit
from needlefem.alterovitz2003.figures_turning import draw_turning
from needlefem.errors import SimulationError
from needlefem.io.result_folder import write_text
from needlefem.planning.plan import plan
from needlefem.planning.result import Plan, Release
from needlefem.plotting.plan_figures import draw_depth, draw_height, planner_of
from needlefem.plotting.stages import draw_stages
from needlefem.scene import Scene
from needlefem.studies.targets import TargetTable, draw_targets, target_table

HEAD = """# The paper's figures

Figures of Alterovitz et al., *Sensorless Planning for Medical Needle Insertion Procedures*,
IROS 2003, drawn from our own answers by `make figures`, which writes this page. Fig. 2 of the
paper is a sketch: `needlefem render CASE --setup` draws such a scene. Which
numbers were calibrated is said in [the case](../cases/prostate-2003/README.md).
"""

HEIGHTS = (-3e-3, 3e-3)
"""What Fig. 6 shows, m from the target's height."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure with what it says.

    Parameters
    ----------
    number : int
        In the paper.
    file : str
    caption : str
    rows : sequence of (quantity, paper's, ours)
    """

    number: int
    file: str
    caption: str
    rows: Sequence[tuple[str, str, str]]

    def text(self, folder: str) -> str:
        """Return the figure as Markdown; its file lies in `folder` from the page."""
        table = [
            "| | paper | here |",
            "|---|---|---|",
            *(f"| {' | '.join(r)} |" for r in self.rows),
        ]
        picture = f"![{self.caption}]({folder}/{self.file})"
        return "\n".join([f"## Fig. {self.number}", "", picture, "", self.caption, "", *table, ""])


def draw_figures(scene: Scene, page: Path, folder: Path) -> list[Figure]:
    """Draw all figures into a folder and write the page that shows them.

    Raises
    ------
    SimulationError
        The scene's plan has no release, or what happens without it is not known.
    """
    found = plan(scene)
    if found.best is None or found.unplanned is None or found.depth_only is None:
        why = "; ".join([found.sentence, *found.missing.values()])
        raise SimulationError(f"without releases there are no figures: {why}")
    depth = _depth(found.unplanned, found)
    draw_stages(scene, found, folder / "figure-1.webp", ultrasound=True)
    angle = draw_turning(found.level, depth, folder / "figure-3.png")
    moved = draw_moved_target(found.level, found.target, depth, folder / "figure-4.png")
    planner = planner_of(scene, found)
    draw_depth(planner, found, folder / "figure-5.png")
    draw_height(planner, found, folder / "figure-6.png", HEIGHTS)
    table = target_table(scene, draw_targets(scene))
    draw_targets_hit(scene, table, folder / "figure-7.png")
    figures = [
        _placement(found.unplanned, found.best),
        _turn(angle),
        _target(moved),
        _depths(found.unplanned, found.depth_only, found),
        _heights(found.best, found),
        _targets(table),
    ]
    where = folder.relative_to(page.parent).as_posix()
    write_text(page, "\n".join([HEAD, *(figure.text(where) for figure in figures)]))
    return figures


def _depth(release: Release, found: Plan) -> float:
    return float(found.level.axis.axial_coordinate(release.release_point))


def _point(point: Sequence[float] | np.ndarray, digits: int = 2) -> str:
    return "(" + ", ".join(f"{100 * float(x):.{digits}f}" for x in point) + ") cm"


def _error(value: float) -> str:
    return f"{100 * value:.3f} cm" if value >= 1e-5 else f"{100 * value:.0e} cm"


def _placement(unplanned: Release, best: Release) -> Figure:
    return Figure(
        number=1,
        file="figure-1.webp",
        caption="Before insertion, seed released, needle retracted, placement error; without "
        "(left) and with a plan (right). The ultrasound is synthetic.",
        rows=(
            ("unplanned seed rests at", "(1.41, 2.21) cm", _point(unplanned.placed_at, 3)),
            ("unplanned placement error", "0.79 cm", _error(unplanned.placement_error)),
            ("left by the search on the planning model", "0.003 cm", _error(best.placement_error)),
        ),
    )


def _turn(angle: float) -> Figure:
    way = "clockwise" if angle < 0.0 else "counter-clockwise"
    ours = f"{abs(np.degrees(angle)):.1f}\u00b0 {way}"
    return Figure(
        number=3,
        file="figure-3.png",
        caption="The needle pushes against the lower half of the prostate, which turns because it "
        "is stiffer than the tissue around it.",
        rows=(("turn of the prostate's outline", "clockwise, slightly", ours),),
    )


def _target(moved: float) -> Figure:
    return Figure(
        number=4,
        file="figure-4.png",
        caption="The target in the reference (cross) and in the world (dot), before the insertion "
        "and with the tip at the target's depth.",
        rows=(("displacement of the target", "not given", f"{1000 * moved:.2f} mm"),),
    )


def _depths(unplanned: Release, depth_only: Release, found: Plan) -> Figure:
    return Figure(
        number=5,
        file="figure-5.png",
        caption="Placement error against depth at the target's height.",
        rows=(
            ("error at the target's depth", "0.79 cm", _error(unplanned.placement_error)),
            ("best depth", "3.84 cm", f"{100 * _depth(depth_only, found):.3f} cm"),
            ("error there", "0.14 cm", _error(depth_only.placement_error)),
        ),
    )


def _heights(best: Release, found: Plan) -> Figure:
    axis = found.insertion.axis
    height = float(best.release_point @ axis.lateral_directions[0])
    return Figure(
        number=6,
        file="figure-6.png",
        caption="Best depth and its error against the insertion height.",
        rows=(
            ("best height", "1.59 cm", f"{100 * height:.3f} cm"),
            (
                "best depth",
                "3.80 cm",
                f"{100 * float(axis.axial_coordinate(best.release_point)):.3f} cm",
            ),
            ("left there by the search", "0.003 cm", _error(best.placement_error)),
        ),
    )


def _targets(table: TargetTable) -> Figure:
    ours = f"{100 * table.unplanned_mean:.3f} ({100 * table.unplanned_sd:.3f}) cm"
    return Figure(
        number=7,
        file="figure-7.png",
        caption=f"{len(table.plans)} targets drawn at random: where seeds come to rest without "
        "(left) and with plans (right).",
        rows=(
            ("unplanned error, mean (SD)", "0.59 (0.10) cm", ours),
            ("left by the searches, mean", "0.002 cm", _error(table.planned_mean)),
        ),
    )
