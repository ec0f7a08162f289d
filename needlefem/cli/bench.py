"""``needlefem bench``."""

import argparse
from pathlib import Path

from needlefem.cli.common import named, say, say_json
from needlefem.cli.experiments import benchmark, benchmarks, comparison
from needlefem.cli.installation import machine
from needlefem.errors import CaseError
from needlefem.io.result_folder import held_by, probe, write_json, write_text
from needlefem.plotting.verification_report import chart_page


def run_benchmark(options: argparse.Namespace) -> int:
    """Run a benchmark on a case and print its table; 1 if a ratio is beyond its bound."""
    if options.benchmark == "list":
        for name, sentence in benchmarks().items():
            say(f"{name:14s}{sentence}")
        return 0
    run = benchmark(options.benchmark)
    folder = None if options.out is None else Path(named(options.out))
    if folder is not None:
        _free(folder, options.benchmark)
    if options.against is not None:
        run = comparison(options.benchmark, Path(named(options.against)))
    table = run(options.case)
    record = {"benchmark": options.benchmark, **table.record(), "machine": machine()}
    if folder is not None:
        (folder / f"{options.benchmark}.html").unlink(missing_ok=True)
        write_json(folder / f"{options.benchmark}.json", record)
        if table.charts:
            write_text(folder / f"{options.benchmark}.html", chart_page(table.title, table.charts))
    if options.json:
        say_json(record)
    else:
        say(table.text())
    return 0 if table.passed else 1


def _free(folder: Path, name: str) -> None:
    """Refuse, before anything is measured, a folder that can't be written or has other files.

    The results of several benchmarks may lie in one folder.
    """
    held = held_by(folder)
    if held is not None:
        problem = f"'{folder}' holds the result of '{held}'"
        raise CaseError("--out", problem, "give another folder, or remove it")
    page, data = folder / f"{name}.html", folder / f"{name}.json"
    if page.exists() and not data.exists():
        raise CaseError("--out", f"'{page}' is no result of this command", "give another folder")
    probe(data)
    probe(page)
