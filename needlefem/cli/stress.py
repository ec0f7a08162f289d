"""``needlefem verify --stress``."""

import argparse
from pathlib import Path

from needlefem.cli.common import say, say_json
from needlefem.errors import CaseError
from needlefem.stress import scenes


def main(options: argparse.Namespace) -> int:
    """Run random scenes or damaged inputs and report; 1 if a requirement is not met."""
    numbers = _numbers(options)
    runs = scenes.run_scenes(options.seed, numbers, options.processes, scenes.warn_line)
    if options.json:
        say_json(scenes.record(options.seed, runs))
    else:
        say(scenes.summary(runs).text())
        for line in scenes.listing(options.seed, runs):
            say(line)
    if options.out and options.only is not None:
        path = scenes.write_scene(options.seed, options.only, Path(options.out))
        if not options.json:
            say(f"written: {path}")
    return 0 if scenes.passed(runs) else 1


def _numbers(options: argparse.Namespace) -> list[int]:
    if options.only is not None:
        return [options.only]
    count = scenes.COUNT if options.count is None else options.count
    if count < 1:
        raise CaseError("--count", f"{count} scenes", "give 1 at least")
    return list(range(count))
