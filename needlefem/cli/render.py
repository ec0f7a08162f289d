"""``needlefem render``."""

import argparse
from pathlib import Path

from needlefem.cli.common import GOOD, named, progress, say, say_json, warn
from needlefem.cli.replay import replay, scene_of
from needlefem.errors import CaseError
from needlefem.output.driver import renderer
from needlefem.output.files import probe
from needlefem.output.images import MOVING, STILLS, require_kind
from needlefem.output.quantities import quantity
from needlefem.output.render import Shot, animate, panels, render
from needlefem.output.setuppicture import draw_setup
from needlefem.units import parse_quantity


def main(options: argparse.Namespace) -> int:
    """Draw a case or a result into a file; return the exit status."""
    renderer()  # before anything is simulated
    shot = Shot(field=options.field, texture=options.texture, size=_size(options.size))
    if options.field:
        quantity(options.field)
    path = Path(named(options.out))
    still = options.setup or options.panels or options.time or options.depth
    require_kind(path, STILLS if still else tuple(dict.fromkeys((*STILLS, *MOVING))))
    probe(path)
    if options.setup:
        draw_setup(scene_of(options.case, options.overrides), path, size=shot.size)
    else:
        _draw(options, path, shot)
    record = {"file": str(path), "field": options.field or None, "texture": options.texture or None}
    if options.json:
        say_json(record)
    else:
        say(f"wrote {path}")
    return 0


def _draw(options: argparse.Namespace, path: Path, shot: Shot) -> None:
    watch = progress("moving")
    insertion = replay(options.case, options.overrides, watch)
    beside = replay(options.beside, options.overrides, watch) if options.beside else None
    shown = [found for found in (insertion, beside) if found is not None]
    ends = [found.outcome for found in shown if found.outcome.status not in GOOD]
    warn([f"the motion is shown as far as it goes: {end.sentence}" for end in ends])
    time = parse_quantity(options.time, "time", "--time") if options.time else None
    depth = parse_quantity(options.depth, "length", "--depth") if options.depth else None
    still = time is not None or depth is not None
    if options.panels:
        panels(insertion, path, count=options.panels, shot=shot)
    elif path.suffix in MOVING and not still:
        animate(insertion, path, frames=options.frames, rate=options.rate, beside=beside, shot=shot)
    else:
        render(insertion, path, depth=depth, time=time, beside=beside, shot=shot)


def _size(text: str) -> tuple[int, int]:
    wide, _, high = text.partition("x")
    if not (wide.isdecimal() and high.isdecimal() and int(wide) >= 200 and int(high) >= 150):
        raise CaseError("--size", f"'{text}' is no size", "write width x height, as in 1280x720")
    return int(wide), int(high)
