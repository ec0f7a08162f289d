"""``needlefem check --element NAME --material NAME``, and ``--integrator NAME``."""

import argparse
import dataclasses
from collections.abc import Mapping

from needlefem._table import Table
from needlefem.checks.integrator_checks import check_integrator, measured
from needlefem.checks.qualify import check_element_material, failures
from needlefem.checks.result import CheckResult
from needlefem.cli.common import say, say_json
from needlefem.dynamics import NAMES, integrator_class
from needlefem.elements import CATALOGUE, element_row
from needlefem.errors import CaseError, nearest
from needlefem.materials import LAWS
from needlefem.materials.catalogue import example

EVERY = "all"


def main(options: argparse.Namespace) -> int:
    """Qualify elements and materials; 1 if a check fails."""
    settings = dict(_assignment(text) for text in options.settings)
    if options.integrator:
        return _integrators(options, settings)
    found: dict[tuple[str, str], tuple[CheckResult, ...]] = {}
    for element in _names(options.element or "P2", list(CATALOGUE)):
        row = element_row(element, "--element")
        for material in _names(options.material or "isotropic", list(LAWS)):
            law = example(material, settings)
            found[element, material] = check_element_material(row, law, options.plane)
    return _say(options, found)


def _say(
    options: argparse.Namespace,
    found: dict[tuple[str, str], tuple[CheckResult, ...]],
    numbers: Mapping[tuple[str, str], Mapping[str, float]] | None = None,
) -> int:
    numbers = numbers or {}
    if options.json:
        say_json([_record(pair, checks, numbers.get(pair)) for pair, checks in found.items()])
    elif len(found) == 1:
        say(_checks(*next(iter(found.items()))).text())
    else:
        say(_overview(found).text())
    if numbers and not options.json:
        say(_numbers(numbers).text())
    return 1 if any(failures(checks) for checks in found.values()) else 0


def _integrators(options: argparse.Namespace, settings: dict[str, str]) -> int:
    """Qualify integrators that move mass; 1 if a check fails."""
    moving = [name for name in NAMES if name != "quasi_static"]
    found: dict[tuple[str, str], tuple[CheckResult, ...]] = {}
    numbers: dict[tuple[str, str], dict[str, float]] = {}
    for name in _names(options.integrator, moving):
        if name == "quasi_static":
            remedy = "see critical_step and convergence_in_time for its accuracy"
            raise CaseError("--integrator", "quasi-static steps move no mass", remedy)
        constants = {key: _number(value, key) for key, value in settings.items()}
        theory = constants.pop("order", 2.0)
        cls = integrator_class(name, "--integrator")
        known = [field.name for field in dataclasses.fields(cls)]
        for key in constants:
            if key not in known:
                raise CaseError(f"--set {key}", "unknown parameter", nearest(key, known))
        pair, integrator = (name, "an oscillator"), cls(**constants)
        found[pair] = check_integrator(integrator, theory)
        numbers[pair] = measured(integrator)
    return _say(options, found, numbers)


def _numbers(numbers: Mapping[tuple[str, str], Mapping[str, float]]) -> Table:
    rows = dict.fromkeys(name for values in numbers.values() for name in values)
    return Table(
        title="measured",
        columns=("quantity", *(name for name, _ in numbers)),
        rows=[
            [row, *(f"{v[row]:.6g}" if row in v else "refused" for v in numbers.values())]
            for row in rows
        ],
    )


def _number(text: str, key: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise CaseError(f"--set {key}", f"'{text}' is not a number", "write a number") from None


def _names(wanted: str, known: list[str]) -> list[str]:
    return known if wanted == EVERY else [wanted]


def _assignment(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise CaseError("--set", f"'{text}' is not an assignment", "write constant=value")
    return key.strip(), value.strip().strip("\"'")


def _record(
    pair: tuple[str, str], checks: tuple[CheckResult, ...], numbers: Mapping[str, float] | None
) -> dict[str, object]:
    return {
        **({"measured": numbers} if numbers else {}),
        "what": pair[0],
        "on": pair[1],
        "passed": not failures(checks),
        "checks": [{**dataclasses.asdict(c), "passed": c.passed} for c in checks],
    }


def _checks(pair: tuple[str, str], checks: tuple[CheckResult, ...]) -> Table:
    failed = failures(checks)
    return Table(
        title=f"{pair[0]} with {pair[1]}",
        columns=("check", "value", "bound", "verdict", "requirement"),
        rows=[
            [c.name, f"{c.value:.2e}", f"{c.bound:.1e}", "passed" if c.passed else "FAILED",
             c.requirement]
            for c in checks
        ],
        passed=not failed,
        note=f"{len(checks)} checks, {len(failed)} failed",
    )  # fmt: skip


def _overview(found: dict[tuple[str, str], tuple[CheckResult, ...]]) -> Table:
    rows = [
        [*pair, len(checks), ", ".join(failures(checks)) or "none"]
        for pair, checks in found.items()
    ]
    return Table(
        title="qualification",
        columns=("element or integrator", "material or order", "checks", "failed"),
        rows=rows,
        passed=not any(failures(checks) for checks in found.values()),
    )
