"""``needlefem bench``."""

import argparse

from needlefem.bench import BENCHMARKS, benchmark
from needlefem.cli.common import say, say_json


def main(options: argparse.Namespace) -> int:
    """Run a benchmark on a case and print its table; 1 if a ratio is beyond its bound."""
    if options.benchmark == "list":
        for name, sentence in BENCHMARKS.items():
            say(f"{name:14s}{sentence}")
        return 0
    table = benchmark(options.benchmark)(options.case)
    if options.json:
        say_json({"benchmark": options.benchmark, **table.record()})
    else:
        say(table.text())
    return 0 if table.passed else 1
