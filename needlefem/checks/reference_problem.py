"""Reference problems: quantities, reference values, tolerances, and records of earlier runs."""

import dataclasses
import importlib.util
import json
import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from needlefem._progress import doing
from needlefem.checks.work_precision import WorkPrecision
from needlefem.errors import CaseError, nearest
from needlefem.fem.boundary_value_problem import StaticSolution

OTHER_FOLDERS = ("support", "studies", "benchmarks")
"""Subfolders of a folder of problems that contain no problems."""
RECORD_TOLERANCE = 1e-8
"""Largest relative difference from the record of an earlier run."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Quantity:
    """A computed number with its reference value and tolerance.

    Parameters
    ----------
    label : str
    value : float
    reference : float
        Reference value; 0 for an error.
    tolerance : float
        Largest distance from the reference; relative, unless the reference is 0.
    recorded : bool
        Whether the number is compared with a record (round-off is not).
    at_least : bool
        The reference is a lower bound. It is used for expected failures, such as the locking of an
        element.
    """

    label: str
    value: float
    reference: float = 0.0
    tolerance: float = 0.0
    recorded: bool = True
    at_least: bool = False

    @property
    def distance(self) -> float:
        """Distance from the reference, relative unless that is 0; 0 above an `at_least`."""
        if self.at_least and self.value >= self.reference:
            return 0.0
        apart = abs(self.value - self.reference)
        return apart / abs(self.reference) if self.reference else apart

    @property
    def passed(self) -> bool:
        """Whether the value is within the tolerance (never for NaN)."""
        return self.distance <= self.tolerance


@dataclasses.dataclass(frozen=True, kw_only=True)
class Curve:
    """An error under mesh refinement.

    Parameters
    ----------
    element : str
    quantity : str
        Name of the error, such as "displacement, L2".
    sizes : tuple of float
        Element size, in any unit.
    dofs : tuple of int
        Number of unknowns.
    seconds : tuple of float
        Time of assembly and solution.
    errors : tuple of float
        Relative, positive.
    order : float, optional
        Theoretical order of ``error ~ size^order``.
    """

    element: str
    quantity: str
    sizes: tuple[float, ...]
    dofs: tuple[int, ...]
    seconds: tuple[float, ...]
    errors: tuple[float, ...]
    order: float | None = None

    @property
    def observed(self) -> float:
        """Order of convergence between the two finest meshes."""
        error, size = self.errors[-2] / self.errors[-1], self.sizes[-2] / self.sizes[-1]
        return math.log(error) / math.log(size)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Shape:
    """A deformed mesh for the report.

    Parameters
    ----------
    title : str
    solution : StaticSolution
    magnified : float
        Factor on the displacement.
    """

    title: str
    solution: StaticSolution
    magnified: float = 1.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class ProblemResult:
    """Quantities, curves and shapes of a problem's run."""

    quantities: Sequence[Quantity]
    curves: Sequence[Curve] = ()
    shapes: Sequence[Shape] = ()


@dataclasses.dataclass(frozen=True, kw_only=True)
class Problem:
    """A reference problem.

    Parameters
    ----------
    name : str
    requirement : str
        What is required of the software.
    reference : str
        Source of the reference value: formula, author, year.
    tolerance_rationale : str
        Reason for the tolerance.
    run : callable
        Takes whether the run is quick (coarse meshes, seconds) and returns the result. A quick run
        returns a subset of the quantities with the same labels.
    races : sequence of WorkPrecision
        Benchmarks that use the problem.
    """

    name: str
    requirement: str
    reference: str
    tolerance_rationale: str
    run: Callable[[bool], ProblemResult]
    races: Sequence[WorkPrecision] = ()


@dataclasses.dataclass(frozen=True, kw_only=True)
class Verdict:
    """A quantity with both comparisons; `record` is None if it is not recorded."""

    problem: str
    answer: Quantity
    record: bool | None
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether the quantity agrees with reference and record."""
        return self.answer.passed and self.record is not False


def load_problems(folder: Path, names: Sequence[str] = ()) -> list[Problem]:
    """Return the problems of a folder and its subfolders; each file defines ``PROBLEM``.

    Raises
    ------
    CaseError
        The folder does not exist, or a name is unknown.
    """
    files = [*sorted(folder.glob("[a-z]*.py")), *sorted(folder.glob("[a-z]*/[a-z]*.py"))]
    files = [file for file in files if file.parent.name not in OTHER_FOLDERS]
    if not files:
        remedy = "give 'verification' of a source tree, or a folder of yours"
        raise CaseError("--problems", f"no problems in '{folder}'", remedy)
    known = {file.stem: file for file in files}
    for name in names:
        if name not in known:
            raise CaseError("names", f"no problem '{name}'", nearest(name, known))
    make_importable(folder)
    return [_load(known[name]) for name in names or known]


def make_importable(folder: Path) -> None:
    """Make the folder of problems importable as a package, for its common files."""
    place = str(folder.resolve().parent)
    if place not in sys.path:
        sys.path.append(place)


def _load(file: Path) -> Problem:
    spec = importlib.util.spec_from_file_location(f"verification_{file.stem}", file)
    if spec is None or spec.loader is None:
        raise CaseError("--problems", f"can't load '{file}'", "give a Python file")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    problem = getattr(module, "PROBLEM", None)
    if not isinstance(problem, Problem):
        raise CaseError("--problems", f"'{file}' has no PROBLEM", "write PROBLEM = Problem(...)")
    return problem


@dataclasses.dataclass(frozen=True, kw_only=True)
class Report:
    """A problem, its result, and the comparisons of its quantities."""

    problem: Problem
    findings: ProblemResult
    verdicts: Sequence[Verdict]
    seconds: float


def run_problem(problem: Problem, records: Mapping[str, float], *, quick: bool = False) -> Report:
    """Run a problem and compare each quantity with reference and record."""
    doing(problem.name)
    start = time.perf_counter()
    findings = problem.run(quick)
    return judged(problem, findings, records, time.perf_counter() - start)


def judged(
    problem: Problem, findings: ProblemResult, records: Mapping[str, float], seconds: float
) -> Report:
    """Compare the result of a problem's run with references and records."""
    verdicts = [
        Verdict(
            problem=problem.name,
            answer=answer,
            record=_same(answer, records.get(f"{problem.name}: {answer.label}")),
            seconds=seconds,
        )
        for answer in findings.quantities
    ]
    return Report(problem=problem, findings=findings, verdicts=verdicts, seconds=seconds)


def _same(answer: Quantity, record: float | None) -> bool | None:
    """Return whether a quantity agrees with its record; errors are compared absolutely."""
    if not answer.recorded:
        return None
    if record is None:
        return False
    scale = abs(record) if answer.reference else 1.0
    return abs(answer.value - record) <= RECORD_TOLERANCE * scale


def read_records(folder: Path) -> dict[str, float]:
    """Return the records of a folder of problems; empty if there are none."""
    file = folder / "records.json"
    if not file.exists():
        return {}
    found: dict[str, float] = json.loads(file.read_text(encoding="utf-8"))
    return found


def records_of(verdicts: Sequence[Verdict]) -> dict[str, float]:
    """Return the numbers to be stored as records."""
    return {f"{v.problem}: {v.answer.label}": v.answer.value for v in verdicts if v.answer.recorded}
