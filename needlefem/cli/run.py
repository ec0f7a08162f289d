"""``needlefem run``."""

import argparse
import dataclasses
from pathlib import Path
from typing import NamedTuple

from needlefem.casefile.load import load_case
from needlefem.checks.mesh_checks import overlaps
from needlefem.cli.common import (
    GOOD,
    centimetres,
    progress,
    refuse_unused_keys,
    refuse_unused_options,
    result_of,
    say,
    say_json,
    undrawn,
    unused_keys,
    warn,
)
from needlefem.errors import NoRendererError
from needlefem.insertion.cut_path import TipPoint
from needlefem.insertion.cut_path import TipTrajectory as CutPath
from needlefem.insertion.energy_balance import energy_terms
from needlefem.insertion.insertion_run import SaveAt
from needlefem.insertion.result import EnergyTerms, Insertion, StrainCheck, validity
from needlefem.insertion.simulation import Discretised, Simulation, discretised
from needlefem.io.expectations import expect_record, judged
from needlefem.io.records import (
    SeedRecord,
    energy_record,
    insertion_record,
    origin,
    released_record,
    scanner_lines,
    seed_record,
    with_scanner,
)
from needlefem.io.result_folder import ResultFolder, write_json
from needlefem.io.vtu import History, recorded_states
from needlefem.needle.clearance import passings
from needlefem.plotting.charts import draw_forces, draw_sticking
from needlefem.plotting.render import write_snapshots
from needlefem.scene import Scene
from needlefem.scene.limits import check_count
from needlefem.scene.version_1 import with_old_keys


def main(options: argparse.Namespace) -> int:
    """Let the needle do what the case says, print, write; return the exit status."""
    if not options.out:
        refuse_unused_options(options, [("snapshots", "they are written to --out DIR")])
    scene = load_case(options.case, options.overrides)
    refuse_unused_keys(scene, "run")
    check_count(options.snapshots, "--snapshots", scene.limits, least=0)
    with result_of(options, "run") as result:
        save = SaveAt(fields=True if options.snapshots else None)
        moved, record = _moved(scene, result, save)
        expected, why = judged(scene, record, "run")
        public = with_old_keys(record | expect_record(expected, why), "run")
        undrawn = None
        if result is not None:
            undrawn = _write(moved.insertion, public, result.path, options)
    if options.json:
        say_json(public)
    else:
        _summary(moved, scanner_lines(record))
        warn(moved.warnings)
        if expected is not None:
            say("\n" + expected.text())
        elif why:
            say("  " + why)
    if undrawn is not None:
        raise undrawn
    if moved.insertion.outcome.status not in GOOD:
        return 3
    return 0 if expected is None or expected.passed else 1


class _Moved(NamedTuple):
    """What the needle does, and its seeds, energy and strains at the last state."""

    insertion: Insertion
    on: Discretised
    seeds: list[SeedRecord]
    energies: EnergyTerms
    strains: StrainCheck
    warnings: list[str]


def _moved(
    scene: Scene, result: ResultFolder | None, save: SaveAt
) -> tuple[_Moved, dict[str, object]]:
    """Return what the needle does, and its record."""
    simulation = Simulation(scene, watch=progress("moving"), expected_insertions=1)
    simulation.check()
    course = simulation.insertion_run(simulation.entry_of_case())
    states = None
    if result is not None:
        result.begin()
        states = recorded_states(course, History(folder=result.path))
    insertion = simulation.complete(course, save=save, states=states)
    strains = validity(insertion, len(insertion.states) - 1)
    moved = _Moved(
        insertion=insertion,
        on=discretised(simulation, simulation.entry_of_case()),
        seeds=_seeds(insertion),
        energies=energy_terms(insertion),
        strains=strains,
        warnings=[*_warnings(simulation, insertion, strains), *unused_keys(scene, "run")],
    )
    record = origin(scene) | insertion_record(insertion)
    record |= {
        "discretization": dataclasses.asdict(moved.on),
        "seeds": moved.seeds,
        "energy": energy_record(moved.energies),
        "validity": vars(strains),
        "timings": {},
        "skipped": simulation.resolved.skipped,
        "reasons": simulation.reasons,
        "warnings": moved.warnings,
    }
    return moved, with_scanner(record, scene)


def _write(
    insertion: Insertion, record: dict[str, object], folder: Path, options: argparse.Namespace
) -> NoRendererError | None:
    """Write what is not written yet; return why there are no pictures, if that is so."""
    write_json(folder / "run.json", record)
    if options.snapshots:
        write_snapshots(insertion, folder, options.snapshots)
    if options.no_pictures:
        return None
    return undrawn(
        lambda: (
            draw_forces(insertion, folder / "forces.png"),
            draw_sticking(insertion, folder / "sticking.png"),
        )
    )


def _warnings(simulation: Simulation, insertion: Insertion, strains: StrainCheck) -> list[str]:
    """Return a sentence for everything in an insertion that should not be believed."""
    warnings = [*simulation.warnings, *strains.warnings()]
    warnings += overlaps(simulation.model.mesh, simulation.scene.contours)
    deepest = max(float(insertion.depths.max()), 0.0)
    passed = passings(insertion.scene.obstacles, insertion.axis, deepest)
    warnings += [f"the needle {passing}" for passing in passed if not passing.allowed]
    return [*warnings, *insertion.rupture_warnings]


def _seeds(insertion: Insertion) -> list[SeedRecord]:
    """Return what was released; where the motion releases nothing, a seed at its end."""
    target = insertion.scene.target
    if insertion.seeds:
        rest = insertion.states[-1].seeds
        return [
            released_record(seed, place, target, insertion.axis)
            for seed, place in zip(insertion.seeds, rest, strict=True)
        ]
    last = insertion.states[-1]
    if insertion.scene.motion.stages or insertion.scene.motion.times:
        return []
    reach = CutPath(insertion).at_depth(min(last.depth, insertion.scene.motion.max_depth))
    return [seed_record(insertion, reach or TipPoint(last.depth, last.tip))]


def _summary(moved: _Moved, in_scanner: list[str]) -> None:
    insertion, outcome = moved.insertion, moved.insertion.outcome
    title = insertion.scene.title
    say(f"{title}: {outcome.status}, {outcome.sentence}; {moved.strains.headline}")
    say(f"  entry at {centimetres(insertion.axis.entry)}; depths are measured from there")
    if insertion.puncture_depth is not None:
        say(f"  skin cut at {100 * insertion.puncture_depth:.3f} cm")
    for event in insertion.events:
        name = f" {event.name}" if event.name else ""
        at = f"at {event.time:.2f} s, {100 * event.depth:.3f} cm"
        say(f"  {event.kind}{name} {at}, energy {event.energy:.3g} J/m")
    for seed in moved.seeds:
        say(_seed_line(seed))
    for line in in_scanner:
        say(line)
    last = insertion.states[-1]
    force = last.tip_force + float(last.friction_force.sum())
    say(f"  force {force:.4g} N/m, of which the tip {last.tip_force:.4g} N/m")
    energy = energy_record(moved.energies)
    terms = (
        "strain", "kinetic", "friction", "cutting", "rupture", "lateral_penalty_energy",
        "contact_activation", "crack_front", "viscoelastic", "damping", "algorithmic_dissipation",
    )  # fmt: skip
    spent = ", ".join(
        f"{t.replace('_', ' ')} {energy[t]:.4g}"
        for t in terms
        if abs(energy[t]) > 1e-9 * abs(energy["work"])
    )
    say(f"  work {energy['work']:.4g} J/m = {spent}")
    say(f"  energy balance closes to {energy['residual']:.1e} of the work")
    say(f"  discretisation: {moved.on}")


def _seed_line(seed: SeedRecord) -> str:
    name = f"{seed['name']} " if seed["name"] else ""
    error = "" if seed["placement_error"] is None else (
        f", {100 * seed['placement_error']:.3f} cm from the target"
    )  # fmt: skip
    if seed["status"] == "not_placed":
        return (
            f"  nothing is placed, because the insertion ended early at a depth of "
            f"{100 * seed['release_depth']:.3f} cm; a seed released there would come to rest at "
            f"{centimetres(seed['placed_at'])}{error}"
        )
    return (
        f"  {name}released at {centimetres(seed['released_at'])}, "
        f"depth {100 * seed['release_depth']:.3f} cm: {seed['status']}, "
        f"rests at {centimetres(seed['placed_at'])}{error}"
    )
