"""``needlefem study`` and ``needlefem bench``: of the package, and of a verification folder.

Studies and benchmarks that verify the package are stored with its reference problems and are not
installed. They are found in the folder `VERIFICATION` of the working directory.
"""

import argparse
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path

from needlefem._table import Table
from needlefem.bench import BENCHMARKS
from needlefem.casefile.load import load_case
from needlefem.checks.reference_problem import make_importable
from needlefem.cli.common import named, refuse_unused_options, say, say_json
from needlefem.cli.info import machine
from needlefem.errors import CaseError, nearest
from needlefem.io.expectations import judged
from needlefem.io.result_folder import held_by, probe, write_json, write_text
from needlefem.plotting.verification_report import chart_page
from needlefem.scene import Scene
from needlefem.studies import STUDIES

Study = Callable[[Scene, "Scene | None"], list[Table]]
"""Takes a case and, where it compares two, the other one."""
Benchmark = Callable[[str], Table]
"""Takes the path of a case, or of the folder of reference problems."""

VERIFICATION = "verification"
PAPER = {"paper": "the method of 2003 compared with the package's: placement, drift, noise, time"}
"""The study of the method of 2003, which lies in that method's room."""
PAIRED = ("paper", "robust")
"""Studies that compare with a second case."""

OF_PARAMETERS = ("convergence", "elements", "independence", "robust", "smoothness")
"""Studies of parameters, which are functions of one module."""


def studies() -> dict[str, str]:
    """Return what all studies that can be found measure, by name."""
    return STUDIES | PAPER | _of_verification("studies", "STUDIES")


def benchmarks() -> dict[str, str]:
    """Return what all benchmarks that can be found measure, by name."""
    return BENCHMARKS | _of_verification("benchmarks", "BENCHMARKS")


def study(name: str) -> Study:
    """Return a study by name, or raise a `CaseError` with the nearest name."""
    _require("study", name, studies())
    module, function = f"{VERIFICATION}.studies.{name}", "study"
    if name in PAPER:
        module = "needlefem.alterovitz2003.plan"
    elif name in OF_PARAMETERS:
        module, function = "needlefem.studies.parameters", name
    elif name in STUDIES:
        module = f"needlefem.studies.{name}"
    found: Study = getattr(import_module(module), function)
    return found


def benchmark(name: str) -> Benchmark:
    """Return a benchmark by name, or raise a `CaseError` with the nearest name."""
    _require("benchmark", name, benchmarks())
    folder = "needlefem.bench" if name in BENCHMARKS else f"{VERIFICATION}.benchmarks"
    found: Benchmark = import_module(f"{folder}.{name}").run
    return found


def comparison(name: str, other: Path) -> Benchmark:
    """Return a benchmark that compares its costs with those in another checkout.

    Raises
    ------
    CaseError
        The verification folder is not in the working directory.
    """
    if not _of_verification("benchmarks", "BENCHMARKS"):
        problem = f"no folder '{VERIFICATION}' here: it compares checkouts"
        raise CaseError("--against", problem, "run it in a checkout of needlefem")
    against = import_module(f"{VERIFICATION}.benchmarks.against")
    return lambda case: against.run(name, case, other)


def _require(kind: str, name: str, known: Mapping[str, str]) -> None:
    if name in known:
        return
    remedy = nearest(name, known)
    if not Path(VERIFICATION).is_dir():
        remedy += f"; those that prove the package need its folder '{VERIFICATION}' here"
    raise CaseError(kind, f"no {kind} '{name}'", remedy)


def _of_verification(room: str, table: str) -> dict[str, str]:
    folder = Path(VERIFICATION)
    if not (folder / room / "__init__.py").is_file():
        return {}
    make_importable(folder)
    found: dict[str, str] = getattr(import_module(f"{VERIFICATION}.{room}"), table)
    return found


# ``needlefem bench``.


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
        raise CaseError("--out", f"'{page}' is not a result of this command", "give another folder")
    probe(data)
    probe(page)


# ``needlefem study``.


def run_study(options: argparse.Namespace) -> int:
    """Run a study on a case and print its tables; 1 if something demanded doesn't hold."""
    if options.study == "list":
        for name, sentence in studies().items():
            say(f"{name:14s}{sentence}")
        return 0
    run = study(options.study)
    if options.study not in PAIRED:
        unused = f"study '{options.study}' uses a single case"
        refuse_unused_options(options, [("against", unused)])
    scene = load_case(options.case, options.overrides)
    other = load_case(options.against) if options.against else None
    tables = run(scene, other)
    summary = {key: value for table in tables for key, value in table.summary.items()}
    expected, why = judged(scene, summary, options.study)
    if expected is not None:
        tables.append(expected)
    if options.json:
        record = {"study": options.study, "tables": [table.record() for table in tables]}
        say_json(record | {"expect_skipped": why or None})
    else:
        say("\n\n".join([*(table.text() for table in tables), *([why] if why else [])]))
    return 0 if all(table.passed for table in tables) else 1
