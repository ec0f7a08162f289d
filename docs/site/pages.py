"""Run a documentation page: write the files that it shows, run its commands, compare outputs.

A fenced block that begins with ``# name`` is a file; one marked ``console`` has commands, a line
each after ``$``; a nameless ``text`` block right after it is what they print, with ``...`` for
what may differ. ``python docs/site/pages.py PAGE FOLDER`` runs a page in a folder.
"""

import dataclasses
import doctest
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```(python|toml|console|text)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NAME = re.compile(r"# ([\w./-]+\.\w+)\n")
LIKE = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE

Runner = Callable[[list[str], bool], str]
"""Runs a command, which must fail where the flag says so, and returns what it prints."""


@dataclasses.dataclass(frozen=True)
class Step:
    """Commands of a page and what they must print; None where the page doesn't say."""

    commands: tuple[str, ...]
    output: str | None


def files(page: Path) -> dict[str, str]:
    """Return the files that a page shows, by their names; a header line stays in code alone."""
    found = {}
    for kind, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        named = NAME.match(text)
        if kind != "console" and named:
            found[named[1]] = text if kind in ("python", "toml") else text[named.end() :]
    return found


def steps(page: Path) -> Iterator[Step]:
    """Yield what a page runs, in its order."""
    blocks = BLOCK.findall(page.read_text(encoding="utf-8"))
    for number, (kind, text) in enumerate(blocks):
        if kind != "console":
            continue
        following = blocks[number + 1] if number + 1 < len(blocks) else ("", "")
        printed = following[0] == "text" and not NAME.match(following[1])
        commands = tuple(line.removeprefix("$ ") for line in text.splitlines())
        yield Step(commands, following[1] if printed else None)


def run_page(page: Path, runner: Runner) -> int:
    """Write a page's files here and run its commands; return how many ran."""
    for name, text in files(page).items():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(text, encoding="utf-8")
    count = 0
    for step in steps(page):
        printed = ""
        for line in step.commands:
            command, fails, _ = line.partition(" || true")
            printed = runner(shlex.split(command), bool(fails))
            count += 1
        if step.output is not None:
            compare(page, step.output, printed)
    return count


def compare(page: Path, wanted: str, printed: str) -> None:
    """Raise an AssertionError that shows both if a page doesn't say what is printed."""
    if not doctest.OutputChecker().check_output(wanted, printed, LIKE):
        raise AssertionError(f"{page} says\n{wanted}\nbut this is printed:\n{printed}")


def run(command: list[str], fails: bool) -> str:
    """Run a command in a process of its own; end with its status if it fails and should not."""
    here = str(Path(sys.executable).parent)
    found = subprocess.run(
        command, text=True, check=False, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT if fails else None,
        env={**os.environ, "PATH": here + os.pathsep + os.environ["PATH"]},
    )  # fmt: skip
    sys.stdout.write("$ " + shlex.join(command) + "\n" + found.stdout)
    sys.stdout.flush()
    if bool(found.returncode) != fails:
        sys.exit(found.returncode or 1)
    return found.stdout


def main(page: str, folder: str) -> None:
    """Run a page in a folder, where ``cases`` is that of the repository."""
    source = Path(page).resolve()
    Path(folder).mkdir(parents=True, exist_ok=True)
    os.chdir(folder)
    for name in ("cases", "verification"):
        if not Path(name).exists():
            Path(name).symlink_to(ROOT / name)
    run_page(source, run)


if __name__ == "__main__":
    main(*sys.argv[1:])
