"""Reference problems: a question, its known answers, and two verdicts on each."""

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
"""Subfolders of a folder of problems in which no problems are."""
RECORD_TOLERANCE = 1e-8
"""Change against the own record, relative, that counts as a change of the code."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Quantity:
    """One number and what it must be.

    Parameters
    ----------
    label : str
    value : float
    reference : float
        The known answer; 0 for an error that must vanish.
    tolerance : float
        Largest distance to the reference; relative, unless the reference is 0.
    recorded : bool
        Whether the number is kept as own record (round-off is not worth recording).
    at_least : bool
        The value must be no less than the reference: a failure that is expected, such as the
        locking of an element.
    """

    label: str
    value: float
    reference: float = 0.0
    tolerance: float = 0.0
    recorded: bool = True
    at_least: bool = False

    @property
    def distance(self) -> float:
        """Distance to the reference, relative unless that is 0; none beyond an `at_least`."""
        if self.at_least and self.value >= self.reference:
            return 0.0
        apart = abs(self.value - self.reference)
        return apart / abs(self.reference) if self.reference else apart

    @property
    def passed(self) -> bool:
        """Whether the reference is met (NaN never is)."""
        return self.distance <= self.tolerance


@dataclasses.dataclass(frozen=True, kw_only=True)
class Curve:
    """An error on finer and finer meshes.

    Parameters
    ----------
    element : str
    quantity : str
        What is wrong by `errors`, such as "displacement, L2".
    sizes : tuple of float
        Element size, in any unit.
    dofs : tuple of int
        Unknowns solved for.
    seconds : tuple of float
        Of assembly and solution.
    errors : tuple of float
        Relative, positive.
    order : float, optional
        What theory says of ``error ~ size^order``.
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
    """A deformed mesh worth looking at.

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
    """What a problem's run found."""

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
        What the software shall do.
    reference : str
        Where the known answer comes from: formula, author, year.
    tolerance_rationale : str
        Why the tolerance is what it is.
    run : callable
        Takes whether to be quick (coarse meshes, seconds) and returns the findings. Answers of
        a quick run are among those of a whole one, under the same labels.
    races : sequence of WorkPrecision
        What it is good for as a benchmark.
    """

    name: str
    requirement: str
    reference: str
    tolerance_rationale: str
    run: Callable[[bool], ProblemResult]
    races: Sequence[WorkPrecision] = ()


@dataclasses.dataclass(frozen=True, kw_only=True)
class Verdict:
    """An answer with both verdicts; `record` is None for what is not worth recording."""

    problem: str
    answer: Quantity
    record: bool | None
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether reference and record are met."""
        return self.answer.passed and self.record is not False


def load_problems(folder: Path, names: Sequence[str] = ()) -> list[Problem]:
    """Return the problems of a folder and of its subfolders, each from a file's ``PROBLEM``.

    Raises
    ------
    CaseError
        No such folder, or an unknown name.
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
    """Let Python find the package that a folder of problems is: what its files share."""
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
    """A problem, its findings and the verdicts on its answers."""

    problem: Problem
    findings: ProblemResult
    verdicts: Sequence[Verdict]
    seconds: float


def run_problem(problem: Problem, records: Mapping[str, float], *, quick: bool = False) -> Report:
    """Run a problem and judge every answer against reference and own record."""
    doing(problem.name)
    start = time.perf_counter()
    findings = problem.run(quick)
    return judged(problem, findings, records, time.perf_counter() - start)


def judged(
    problem: Problem, findings: ProblemResult, records: Mapping[str, float], seconds: float
) -> Report:
    """Judge what a problem's run found against reference and own record."""
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
    """Say whether an answer is as recorded; an error (reference 0) is compared as it is."""
    if not answer.recorded:
        return None
    if record is None:
        return False
    scale = abs(record) if answer.reference else 1.0
    return abs(answer.value - record) <= RECORD_TOLERANCE * scale


def read_records(folder: Path) -> dict[str, float]:
    """Return the own records of a folder of problems; empty if there are none yet."""
    file = folder / "records.json"
    if not file.exists():
        return {}
    found: dict[str, float] = json.loads(file.read_text(encoding="utf-8"))
    return found


def records_of(verdicts: Sequence[Verdict]) -> dict[str, float]:
    """Return the numbers to keep as own record."""
    return {f"{v.problem}: {v.answer.label}": v.answer.value for v in verdicts if v.answer.recorded}
