"""``needlefem modes``."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from needlefem.arrays import Floats
from needlefem.casefile.load import load_case
from needlefem.cli.common import say, say_json
from needlefem.dynamics import TissueSystem, critical_step
from needlefem.dynamics.modes import modes
from needlefem.errors import CaseError
from needlefem.fem.build import build_model
from needlefem.output.files import write_json
from needlefem.output.vtu import write_vtu
from needlefem.resolve import resolve
from needlefem.table import Table


def main(options: argparse.Namespace) -> int:
    """Find the lowest modes, print, write; return the exit status."""
    scene = resolve(load_case(options.case, options.overrides)).scene
    model = build_model(scene, floating=options.free)
    if not 0 < options.count < len(model.free_dofs) // 2:
        remedy = f"give 1 to {len(model.free_dofs) // 2 - 1}"
        raise CaseError("--count", f"{options.count} modes", remedy)
    system = TissueSystem(model)
    found, shapes = modes(system, options.count)
    hertz = found / (2.0 * np.pi)
    record = {
        "case": scene.title,
        "element": model.element.name,
        "unknowns": system.size,
        "supported": not options.free,
        "frequencies": list(hertz),
        "critical_steps": _limits(system),
    }
    if options.json:
        say_json(record)
    else:
        say(_table(record).text())
    if options.out:
        _write(Path(options.out), record, system, shapes)
        if not options.no_pictures:
            from needlefem.output.modepictures import draw_modes  # noqa: PLC0415

            fields = [system.nodal(shape) for shape in shapes.T]
            path = draw_modes(scene, model, hertz, fields, Path(options.out) / "modes.png")
            if not options.json:
                say(f"wrote {path}")
    return 0


def _limits(system: TissueSystem) -> dict[str, float]:
    """Return the largest stable step of central differences by kind of mass, s."""
    found = {"consistent": critical_step(system)}
    for scheme in system.model.element.lumpings:
        found[scheme] = critical_step(TissueSystem(system.model, lumping=scheme))
    return found


def _table(record: dict[str, Any]) -> Table:
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


def _write(folder: Path, record: dict[str, Any], system: TissueSystem, shapes: Floats) -> None:
    write_json(folder / "modes.json", record)
    fields = {f"mode {i}": system.nodal(shape) for i, shape in enumerate(shapes.T, 1)}
    write_vtu(folder / "modes.vtu", system.model, fields)
