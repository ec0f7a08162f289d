"""``needlefem verify --stress``."""

import argparse
import sys
from pathlib import Path

from needlefem._table import Table
from needlefem.cli.common import say, say_json
from needlefem.errors import CaseError
from needlefem.stress import inputs, scenes


def main(options: argparse.Namespace) -> int:
    """Run random scenes or damaged inputs and report; 1 if a requirement is not met."""
    return _scenes(options) if options.stress == "scenes" else _inputs(options)


def _scenes(options: argparse.Namespace) -> int:
    numbers = _numbers(options, scenes.COUNT)
    runs = scenes.run_scenes(options.seed, numbers, options.processes, _tell)
    asked = len(numbers)
    _report(options, scenes.record(options.seed, runs, asked), scenes.summary(runs, asked),
            scenes.listing(options.seed, runs))  # fmt: skip
    if options.out and options.only is not None:
        path = scenes.write_scene(options.seed, options.only, Path(options.out))
        if not options.json:
            say(f"written: {path}")
    return 0 if scenes.passed(runs, asked) else 1


def _inputs(options: argparse.Namespace) -> int:
    from needlefem.cli.main import main as command_line  # noqa: PLC0415  (it imports this module)

    numbers = _numbers(options, inputs.COUNT)
    if options.out and options.only is not None:
        runs = [inputs.keep_input(command_line, options.seed, options.only, Path(options.out))]
    else:
        runs = inputs.run_inputs(command_line, options.seed, numbers, options.processes, _tell)
    asked = len(numbers)
    _report(options, inputs.record(options.seed, runs, asked), inputs.summary(runs, asked),
            inputs.listing(options.seed, runs))  # fmt: skip
    return 0 if inputs.passed(runs, asked) else 1


def _report(
    options: argparse.Namespace, record: dict[str, object], table: Table, lines: list[str]
) -> None:
    if options.json:
        say_json(record)
        return
    say(table.text())
    for line in lines:
        say(line)


def _numbers(options: argparse.Namespace, most: int) -> list[int]:
    if options.only is not None:
        return [options.only]
    count = most if options.count is None else options.count
    least = {"--count": (count, 1), "--processes": (options.processes, 1),
             "--start": (options.start, 0), "--seed": (options.seed, 0)}  # fmt: skip
    for key, (value, bound) in least.items():
        if value < bound:
            raise CaseError(key, f"{value}", f"give {bound} at least")
    return list(range(options.start, options.start + count))


def _tell(text: str) -> None:
    sys.stderr.write(text + "\n")
    sys.stderr.flush()
