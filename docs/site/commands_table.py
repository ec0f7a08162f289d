"""The commands and their options as a page, from what the parser declares."""

import argparse
from collections.abc import Mapping

from needlefem.cli.experiments import benchmarks, studies
from needlefem.cli.main import COMMANDS, parser_of

NAMED = {"study": studies, "bench": benchmarks}
"""Commands whose first argument is one of some names, and what returns these."""
SHARED = ("help", "json", "debug", "allow_code")
"""What every command has is said once, on the page."""


def describe_commands() -> str:
    """Return all commands with their arguments as Markdown tables."""
    parser = parser_of()
    listed = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    parts = []
    for name, sub in listed.choices.items():
        rows = [_row(action) for action in sub._actions if _shown(action)]
        head = ["| argument | meaning | default |", "|---|---|---|"]
        table = ["", *head, *rows] if rows else []
        sentence = COMMANDS[name][0].upper() + COMMANDS[name][1:] + "."
        names = _names(NAMED[name]() if name in NAMED else {})
        parts.append("\n".join([f"## `needlefem {name}`", "", sentence, *table, *names]))
    return "\n\n".join(parts) + "\n"


def _shown(action: argparse.Action) -> bool:
    """Say whether an argument has a row: old names of options have none."""
    return action.dest not in SHARED and action.help != argparse.SUPPRESS


def _names(names: Mapping[str, str]) -> list[str]:
    rows = [f"| `{name}` | {sentence} |" for name, sentence in names.items()]
    return ["", "| name | what it measures |", "|---|---|", *rows] if rows else []


def _row(action: argparse.Action) -> str:
    cells = [_name(action), action.help or "", _default(action)]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _name(action: argparse.Action) -> str:
    value = action.metavar if isinstance(action.metavar, str) else action.dest.upper()
    if action.choices is not None and action.metavar is None:
        value = ", ".join(map(str, action.choices))
    if not action.option_strings:
        optional = action.nargs in ("?", "*")
        return f"`[{value}]`" if optional else f"`{value}`"
    flag = action.option_strings[-1]
    return f"`{flag}`" if action.nargs == 0 else f"`{flag} {value}`"


def _default(action: argparse.Action) -> str:
    if action.required and action.nargs not in ("?", "*"):
        return "required"
    return "" if action.default in (None, "", False, []) else f"`{action.default}`"
