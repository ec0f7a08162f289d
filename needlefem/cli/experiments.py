"""Studies and benchmarks by name: those of the package, and those of a verification folder.

What proves the package lies beside its reference problems and is not installed. It is found in
the folder `VERIFICATION` of the working directory, as the reference problems are.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path

from needlefem._table import Table
from needlefem.bench import BENCHMARKS
from needlefem.checks.reference_problem import make_importable
from needlefem.errors import CaseError, nearest
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


def studies() -> dict[str, str]:
    """Return what all studies that can be found measure, by name."""
    return STUDIES | PAPER | _of_verification("studies", "STUDIES")


def benchmarks() -> dict[str, str]:
    """Return what all benchmarks that can be found measure, by name."""
    return BENCHMARKS | _of_verification("benchmarks", "BENCHMARKS")


def study(name: str) -> Study:
    """Return a study by name, or raise a `CaseError` with the nearest name."""
    _require("study", name, studies())
    if name in PAPER:
        module = "needlefem.alterovitz2003.study"
    else:
        module = f"{'needlefem' if name in STUDIES else VERIFICATION}.studies.{name}"
    found: Study = import_module(module).study
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
