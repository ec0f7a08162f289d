"""``needlefem plan --method paper`` and ``needlefem figures``: the method of 2003."""

import argparse
from collections.abc import Iterable
from pathlib import Path

from needlefem._table import Table
from needlefem.alterovitz2003.figures import draw_figures
from needlefem.alterovitz2003.plan import Drifted, Timed, drift, own_plan, paper_plan
from needlefem.alterovitz2003.simulation import InTime
from needlefem.casefile.load import load_case
from needlefem.cli.common import (
    named,
    progress,
    refuse_unused_keys,
    release_lines,
    result_of,
    say,
    say_json,
    search_line,
    warn,
)
from needlefem.errors import CaseError
from needlefem.io.records import origin, plan_record, with_scanner
from needlefem.io.result_folder import probe, write_json
from needlefem.planning.result import PlanStatus
from needlefem.plotting.images import renderer
from needlefem.scene import BoxMesh, Scene
from needlefem.scene.version_1 import with_old_keys


def plan_by_paper(options: argparse.Namespace) -> int:
    """Plan by both methods, print, write; return the exit status."""
    if options.search not in (None, "golden"):
        problem = f"'{options.search}', but the method of the paper is golden section"
        raise CaseError("--search", problem, "omit it")
    if options.all_solutions:
        raise CaseError("--all-solutions", "is an option of the method of needlefem", "omit it")
    scene = load_case(options.case, options.overrides)
    refuse_unused_keys(scene, "plan")
    with result_of(options, "plan") as result:
        record, paper, tables = _planned(scene)
        public = with_old_keys(record, "plan")
        if result is not None:
            result.begin()
            write_json(result.path / "plan.json", public)
    if options.json:
        say_json(public)
    else:
        _summary(scene.title, paper, tables)
    return 0 if paper.plan.status is PlanStatus.PLANNED else 3


def _planned(scene: Scene) -> tuple[dict[str, object], Timed, list[Table]]:
    """Return the record of both plans, the paper's plan, and the tables to print."""
    watch = progress("planning")
    paper = paper_plan(scene, watch=watch)
    ours = own_plan(scene)
    drifts: list[tuple[Drifted, Drifted]] = []
    if isinstance(scene.mesh, BoxMesh):
        drifts = list(zip(drift(scene, InTime()), drift(scene, None), strict=True))
    tables = [_beside(paper, ours, scene.axes), _drift(drifts, scene.axes)]
    record = origin(scene) | {"method": "paper"}
    record |= plan_record(paper.plan) | {"seconds": paper.seconds, "steps": paper.steps}
    record |= {
        "expect": None,
        "expect_skipped": "the expected values belong to the method of needlefem"
        if scene.expect
        else None,
        "ours": plan_record(ours.plan) | {"seconds": ours.seconds},
        "drift": tables[1].record()["rows"],
    }
    return with_scanner(record, scene), paper, tables


def _summary(title: str, paper: Timed, tables: list[Table]) -> None:
    plan = paper.plan
    say(f"{title}: {plan.status}, {plan.sentence}")
    for line in (*release_lines(plan), search_line(plan)):
        say(line)
    if plan.evidence is not None:
        say(f"  discretisation: {plan.evidence.discretisation}")
    for table in tables:
        if table.rows:
            say("\n" + table.text())
    if plan.evidence is not None:
        warn(plan.evidence.warnings)


def _beside(paper: Timed, ours: Timed, axes: tuple[str, ...]) -> Table:
    rows = [
        [
            one.name,
            one.plan.status,
            *([None] * len(axes) if one.plan.best is None else _cm(one.plan.best.release_point)),
            None if one.plan.best is None else 100.0 * one.plan.best.placement_error,
            one.plan.insertions,
            one.steps or "none",
            one.seconds,
        ]
        for one in (paper, ours)
    ]
    names = [f"release {axis} (cm)" for axis in axes]
    last = ("error (cm)", "insertions", "time steps", "processor s")
    return Table(
        title="method of the paper and of needlefem on the same mesh",
        columns=("method", "status", *names, *last),
        rows=rows,
    )


def _cm(point: Iterable[float]) -> list[str]:
    return [f"{100.0 * float(x):.4f}" for x in point]


def _drift(drifts: list[tuple[Drifted, Drifted]], axes: tuple[str, ...]) -> Table:
    quantities = [*(f"{axis} (cm)" for axis in axes), "skin cut (cm)"]
    names = [f"{who}, {what}" for who in ("the paper's", "ours") for what in quantities]
    rows = [
        [
            pair[0].refined,
            *(x for one in pair for x in _where(one, len(axes))),
            *(one.status if one.placed_at is None else "reached" for one in pair),
        ]
        for pair in drifts
    ]
    return Table(
        title="final position of an unplanned seed under mesh refinement",
        columns=("refined", *names, "the paper's", "ours"),
        rows=rows,
    )


def _where(one: Drifted, dim: int) -> list[str]:
    cut = "never" if one.punctured_at is None else f"{100.0 * one.punctured_at:.4f}"
    return [*([""] * dim if one.placed_at is None else _cm(one.placed_at)), cut]


# The command ``needlefem figures``.


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
