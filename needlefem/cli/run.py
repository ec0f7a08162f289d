"""``needlefem run``."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from needlefem.casefile.load import load_case
from needlefem.cli.common import centimetres, progress, say, say_json, warn
from needlefem.insertion.ledger import ledger
from needlefem.insertion.path import Path as CutPath
from needlefem.insertion.path import Reach
from needlefem.insertion.result import Insertion, Status
from needlefem.insertion.simulation import Simulation
from needlefem.insertion.validity import validity
from needlefem.output.expectations import compare
from needlefem.output.files import write_csv, write_json
from needlefem.output.records import insertion_record, ledger_record, seed_record
from needlefem.planning.plan import checked

GOOD = (Status.COMPLETED, Status.NOT_PUNCTURED)


def main(options: argparse.Namespace) -> int:
    """Push the needle in, print, write; return the exit status."""
    scene = load_case(options.case, options.overrides)
    with progress("inserting") as watch:
        simulation = Simulation(scene, watch=watch)
        checked(simulation)
        entry = simulation.entry_of_case()
        insertion = simulation.insert(entry)
    record = {"case": scene.title, "overrides": scene.overrides} | insertion_record(insertion)
    record |= _measures(simulation, insertion)
    expected = compare(scene.expect, record, "run", scene.axes)
    record["expect"] = None if expected is None else expected.record()
    if options.json:
        say_json(record)
    else:
        _summary(record, scene.title)
        warn(record["warnings"])
        if expected is not None:
            say("\n" + expected.text())
    if options.out:
        _write(Path(options.out), record, insertion, scene.axes)
    if insertion.outcome.status not in GOOD:
        return 3
    return 0 if expected is None or expected.passed else 1


def _measures(simulation: Simulation, insertion: Insertion) -> dict[str, Any]:
    """Return seed, energy and validity at the last state."""
    scene = simulation.scene
    last = insertion.states[-1]
    reach = CutPath(insertion).at_depth(min(last.depth, scene.motion.max_depth))
    reach = reach or Reach(last.depth, last.tip)
    error = None
    if scene.target is not None:
        error = float(np.linalg.norm(reach.point - np.array(scene.target)))
    energies = ledger(insertion)
    strains = validity(insertion, len(insertion.states) - 1)
    warnings = [*simulation.resolved.warnings, *strains.warnings()]
    if insertion.snaps:
        warnings.append(f"the tip jumps ahead {len(insertion.snaps)} times on its way")
    return {
        "seeds": [seed_record(insertion, reach, error)],
        "energy": ledger_record(energies),
        "validity": vars(strains),
        "timings": {},
        "skipped": simulation.resolved.skipped,
        "reasons": simulation.resolved.reasons,
        "warnings": warnings,
    }


def _summary(record: dict[str, Any], title: str) -> None:
    say(f"{title}: {record['status']}, {record['sentence']}")
    if record["puncture_depth"] is not None:
        say(f"  skin cut at {100 * record['puncture_depth']:.3f} cm")
    seed = record["seeds"][0]
    error = "" if seed["placement_error"] is None else (
        f", {100 * seed['placement_error']:.3f} cm from the target"
    )  # fmt: skip
    say(
        f"  released at {centimetres(seed['released_at'])}: {seed['status']}, "
        f"rests at {centimetres(seed['placed_at'])}{error}"
    )
    force = record["tip_force"][-1] + record["shaft_force"][-1]
    say(f"  force {force:.4g} N/m, of which the tip {record['tip_force'][-1]:.4g} N/m")
    energy = record["energy"]
    terms = ("strain", "friction", "cutting", "snap", "hold", "capture")
    say(f"  work {energy['work']:.4g} J/m = " + ", ".join(f"{t} {energy[t]:.4g}" for t in terms))
    say(f"  energy ledger closes to {energy['residual']:.1e} of the work")


def _write(folder: Path, record: Any, insertion: Insertion, axes: tuple[str, ...]) -> None:
    write_json(folder / "run.json", record)
    header = ["depth [m]", *(f"{a} [m]" for a in axes), "tip force [N/m]", "shaft force [N/m]"]
    forces = np.column_stack([record["tip_force"], record["shaft_force"]])
    write_csv(
        folder / "insertion.csv",
        header,
        np.column_stack([insertion.depths, insertion.tips, forces]),
    )
