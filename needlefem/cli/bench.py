"""``needlefem bench``."""

import argparse
from pathlib import Path

from needlefem.bench import BENCHMARKS, benchmark
from needlefem.cli.common import say, say_json
from needlefem.output.files import write_json, write_text
from needlefem.output.info import machine
from needlefem.output.verification.page import chart_page


def main(options: argparse.Namespace) -> int:
    """Run a benchmark on a case and print its table; 1 if a ratio is beyond its bound."""
    if options.benchmark == "list":
        for name, sentence in BENCHMARKS.items():
            say(f"{name:14s}{sentence}")
        return 0
    table = benchmark(options.benchmark)(options.case)
    record = {"benchmark": options.benchmark, **table.record(), "machine": machine()}
    if options.json:
        say_json(record)
    else:
        say(table.text())
    if options.out:
        folder = Path(options.out)
        write_json(folder / f"{options.benchmark}.json", record)
        if table.charts:
            write_text(folder / f"{options.benchmark}.html", chart_page(table.title, table.charts))
    return 0 if table.passed else 1
