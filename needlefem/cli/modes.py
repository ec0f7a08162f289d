"""``needlefem modes``."""

import argparse
from pathlib import Path
from typing import TypedDict

import numpy as np

from needlefem._arrays import Floats
from needlefem._table import Table
from needlefem.casefile.load import load_case
from needlefem.cli.common import (
    refuse_unused_keys,
    result_of,
    say,
    say_json,
    undrawn,
    unused_keys,
    warn,
)
from needlefem.dynamics import TissueSystem, critical_step
from needlefem.dynamics.system import modes
from needlefem.errors import CaseError, NoRendererError
from needlefem.io.result_folder import ResultFolder, write_json
from needlefem.io.vtu import write_vtu
from needlefem.scene import Scene
from needlefem.scene.build import build_model
from needlefem.scene.resolve import resolve

PICTURE = "modes.png"


class _Record(TypedDict):
    """The result as `docs/json.md` describes it."""

    case: str
    element: str
    unknowns: int
    supported: bool
    frequencies: list[float]
    critical_steps: dict[str, float]


def main(options: argparse.Namespace) -> int:
    """Find the lowest modes, print, write; return the exit status."""
    read = load_case(options.case, options.overrides)
    refuse_unused_keys(read, "modes")
    scene = resolve(read).scene
    with result_of(options, "modes") as result:
        record, missing = _found(options, scene, result)
    if options.json:
        say_json(record)
    else:
        say(_table(record).text())
        warn(unused_keys(read, "modes"))
        if result is not None and not options.no_pictures and missing is None:
            say(f"wrote {result.path / PICTURE}")
    if missing is not None:
        raise missing
    return 0


def _found(
    options: argparse.Namespace, scene: Scene, result: ResultFolder | None
) -> tuple[_Record, NoRendererError | None]:
    """Return the record of the modes, written, and why there is no picture, if that is so."""
    model = build_model(scene, floating=options.unsupported)
    if not 0 < options.count < len(model.free_dofs) // 2:
        remedy = f"give 1 to {len(model.free_dofs) // 2 - 1}"
        raise CaseError("--count", f"{options.count} modes", remedy)
    system = TissueSystem(model)
    found, shapes = modes(system, options.count)
    hertz = found / (2.0 * np.pi)
    record: _Record = {
        "case": scene.title,
        "element": model.element.name,
        "unknowns": system.size,
        "supported": not options.unsupported,
        "frequencies": list(hertz),
        "critical_steps": _limits(system),
    }
    if result is None:
        return record, None
    result.begin()
    _write(result.path, record, system, shapes)
    if options.no_pictures:
        return record, None
    from needlefem.plotting.figures import draw_modes  # noqa: PLC0415

    fields = [system.nodal(shape) for shape in shapes.T]
    return record, undrawn(lambda: draw_modes(scene, model, hertz, fields, result.path / PICTURE))


def _limits(system: TissueSystem) -> dict[str, float]:
    """Return the largest stable step of central differences by kind of mass, s."""
    found = {"consistent": critical_step(system)}
    for scheme in system.model.element.lumpings:
        found[scheme] = critical_step(TissueSystem(system.model, lumping=scheme))
    return found


def _table(record: _Record) -> Table:
    rows = [[i, hertz, 1.0 / hertz if hertz > 1e-6 else "-"]
            for i, hertz in enumerate(record["frequencies"], 1)]  # fmt: skip
    limits = ", ".join(f"{1e3 * s:.3g} ms ({mass})" for mass, s in record["critical_steps"].items())
    held = "" if record["supported"] else ", free"
    return Table(
        title=f"{record['case']}{held}: {record['element']}, {record['unknowns']} unknowns",
        columns=("mode", "frequency (Hz)", "period (s)"),
        rows=rows,
        note=f"central differences are stable up to {limits}",
    )


def _write(folder: Path, record: _Record, system: TissueSystem, shapes: Floats) -> None:
    write_json(folder / "modes.json", record)
    fields = {f"mode {i}": system.nodal(shape) for i, shape in enumerate(shapes.T, 1)}
    write_vtu(folder / "modes.vtu", system.model, fields)
