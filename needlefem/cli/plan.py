"""``needlefem plan``."""

import argparse
from pathlib import Path

from needlefem.casefile.load import load_case
from needlefem.cli.common import (
    progress,
    refuse_unused_keys,
    release_lines,
    result_of,
    say,
    say_json,
    search_line,
    undrawn,
    unused_keys,
    warn,
)
from needlefem.io.expectations import expect_record, judged
from needlefem.io.records import origin, plan_record, scanner_lines, with_scanner
from needlefem.io.result_folder import write_json
from needlefem.planning.plan import plan
from needlefem.planning.result import Evidence, Plan, PlanStatus
from needlefem.scene import Scene
from needlefem.scene.version_1 import with_old_keys


def main(options: argparse.Namespace) -> int:
    """Plan, print, write; return the exit status."""
    if options.method == "paper":
        from needlefem.cli.figures import plan_by_paper  # noqa: PLC0415

        return plan_by_paper(options)
    scene = load_case(options.case, options.overrides)
    refuse_unused_keys(scene, "plan")
    pictures: list[Path] = []
    missing = None
    with result_of(options, "plan") as result:
        watch = progress("planning")
        found = plan(scene, search=options.search, all_solutions=options.all_solutions, watch=watch)
        record = with_scanner(origin(scene) | plan_record(found), scene)
        warnings = [] if found.evidence is None else list(found.evidence.warnings)
        warnings += unused_keys(scene, "plan")
        record["warnings"] = warnings
        expected, why = judged(scene, record, "plan")
        record |= expect_record(expected, why)
        public = with_old_keys(record, "plan")
        if result is not None:
            result.begin()
            write_json(result.path / "plan.json", public)
            if not options.no_pictures:
                missing = undrawn(lambda: pictures.extend(_draw(found, result.path)))
    if options.json:
        say_json(public)
    else:
        _summary(scene, found, scanner_lines(record))
        warn(warnings)
        if expected is not None:
            say("\n" + expected.text())
        elif why:
            say("  " + why)
        for path in pictures:
            say(f"wrote {path}")
    if missing is not None:
        raise missing
    if found.status is not PlanStatus.PLANNED:
        return 3
    return 0 if expected is None or expected.passed else 1


def _draw(found: Plan, folder: Path) -> list[Path]:
    from needlefem.plotting.figures import draw_plan  # noqa: PLC0415

    return draw_plan(found.insertion.scene, found, folder)


def _summary(scene: Scene, found: Plan, in_scanner: list[str]) -> None:
    along = ", ".join(f"{x:.3g}" for x in found.insertion.axis.direction)
    turned = f" along ({along})" if found.rejected_directions else ""
    say(f"{scene.title}: {found.status}{turned}, {found.sentence}")
    for refusal in found.rejected_directions:
        along = ", ".join(f"{x:.3g}" for x in refusal.direction)
        say(f"  along ({along}): {refusal.status}, {refusal.sentence}")
    for line in release_lines(found):
        say(line)
    for passing in found.passings:
        say(f"  the needle {passing}")
    for line in in_scanner:
        say(line)
    say(search_line(found))
    if found.other_solutions is not None:
        heights = ", ".join(f"{100 * h:+.4f} cm" for h in found.other_solutions) or "none"
        scan = f"{found.scan_insertions} insertions to scan"
        say(f"  other offsets that reach the target: {heights} ({scan})")
    if found.evidence is not None:
        checks = found.evidence.preflight
        say(f"  {len(checks)} checks passed before planning: {', '.join(c.name for c in checks)}")
        if found.evidence.energy is not None:
            say(f"  energy balance closes to {found.evidence.energy.residual:.1e} of the work")
        for name, why in found.evidence.missing.items():
            say(f"  {name} not known: {why}")
        _accuracy(found.evidence)
        seconds = sum(found.evidence.timings.values())
        say(f"  {seconds:.2f} s, without: {', '.join(found.evidence.skipped)}")


def _accuracy(evidence: Evidence) -> None:
    """Say what was computed on, what that does to the placement, and what was tried before."""
    if evidence.discretisation is not None:
        say(f"  discretisation: {evidence.discretisation}")
    for tried in evidence.refinement_history:
        sizes = (tried.corridor, tried.contour, tried.bulk, tried.path)
        say(
            f"  tried {tried.element}, {tried.unknowns} unknowns, "
            f"{' / '.join(f'{1e3 * size:.3g}' for size in sizes)} mm (needle / contours / "
            f"elsewhere / path): {1e3 * tried.at_most:.2g} mm, {tried.insertions} insertions"
        )
    if evidence.estimate is not None:
        found = evidence.estimate
        say(
            f"  stated placement error: at most about {1e3 * found.at_most:.2g} mm "
            f"(against {found.compared_to})"
        )
