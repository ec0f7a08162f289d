"""Every command that README and documentation name is run, or read as far as its price allows.

Tutorials and how-to pages are run whole by `test_howto`. Here are all other lines and inline
snippets: the cheap ones are run, with small pictures; of those in `TOO_LONG` the real parser reads
the arguments, and the case, the study or the benchmark that they name must be there; `make
commands` runs them too.
"""

import re
import shlex
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from needlefem import load_case
from needlefem.cli.experiments import benchmark, study
from needlefem.cli.main import main, parser_of
from tests.pages import PAGES, ROOT, WHOLE

PAPER = "cases/prostate-2003/case.toml"
FILLED = {
    r"\\\|--labelmap\\\|--mesh FILE": " cases/prostate/contour.csv",
    "new CASE --json": "new begun --contour cases/prostate/contour.csv --json",
    "new CASE": "new begun",
    "new mine": "new begun",
    "study NAME": "study energy",
    "bench NAME": "bench plan",
    "--element NAME": "--element P1",
    "--material NAME": "--material isotropic",
    "--integrator NAME": "--integrator newmark",
    r"\bDIR\b": "written",
    r"\bCASE\b": PAPER,
}
"""What stands for a reader's own in a command, and what takes its place."""
TOO_LONG = {
    "study": "minutes; `make studies`. `targets` is run by test_cases, `robust` by tests/cli",
    "bench": "timings of minutes; `make bench`",
    "figures": "draws for a minute; `make figures`, and tests/output",
    r"cases/(?!prostate-2003/)\S+\.toml": "run by test_cases, drawn by `make figures`",
    "--stress": "an hour; a sample of both is run by tests/stress",
    "--method paper": "run by tests/planning/test_paper",
    r"out/\S+": "draws what another command of its page wrote",
}
"""Commands with words like these are only read, and why; `make commands` runs them as well."""
ELSEWHERE = {
    "--labelmap": "needs a map: how-to/own-anatomy makes one and is run",
    "--mesh": "needs a mesh: how-to/own-mesh makes one and is run",
    "gland.csv": "needs outlines: tutorial/own-anatomy has them and is run",
}
"""Commands that want a reader's file, and where they are run."""
ONE = "rayleigh"
"""The reference problem that is run where a command means the whole suite: `make verify` runs it,
and `make test` its quick part."""
LINE = re.compile(r"^(?: {4}|\$ )((?:needlefem|make|pip|python) .*)$", re.MULTILINE)
INLINE = re.compile(r"`((?:needlefem|make|pip) [^`]+)`")


def commands() -> list[str]:
    """Return all commands outside of the pages that are run whole, each once."""
    found = {}
    for page in PAGES:
        if page.stem == "CHANGELOG":  # speaks of what was
            continue
        text = page.read_text(encoding="utf-8")
        if page not in WHOLE:
            found |= dict.fromkeys(line.partition("  #")[0].strip() for line in LINE.findall(text))
        inline = (line.replace("\n", " ") for line in INLINE.findall(text))
        found |= dict.fromkeys(inline)
    return sorted(found)


def filled(command: str) -> str:
    """Return a command with a reader's own replaced."""
    for pattern, value in FILLED.items():
        command = re.sub(pattern, value, command)
    return command


NEEDLEFEM = sorted({filled(line) for line in commands() if line.startswith("needlefem ")})


def too_long(command: str) -> bool:
    """Say whether a command is only read."""
    return any(re.search(f" {words}( |$)", command) for words in (*TOO_LONG, *ELSEWHERE))


def elsewhere(command: str) -> bool:
    """Say whether a command is run on a page of its own."""
    return any(re.search(f" {words}( |$)", command) for words in ELSEWHERE)


def complete(command: str) -> bool:
    """Say whether a command can be run; what a sentence calls by its name alone can't."""
    words = shlex.split(command)[1:]
    wants = {"study": 3, "bench": 3, "verify": 1, "info": 1}.get(words[0], 2)
    if wants == 3 and words[-1].startswith("--"):
        return False
    return len(words) >= wants and words[-1] != "..." and words[0] != "COMMAND"


def shortened(arguments: list[str]) -> list[str]:
    """Return a command's arguments with small pictures, or none, and one problem of the suite."""
    name = arguments[0]
    if name == "render":
        return [*arguments, "--size", "320x180", "--out", "picture.png"]
    if name in ("plan", "run", "modes") and "--json" not in arguments:
        return [*arguments, "--no-pictures"]
    if name == "verify" and not {"--element", "--integrator", "bimaterial_bar"} & {*arguments}:
        return [*arguments, ONE]
    return arguments


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with copies of what a reader has."""
    for name in ("cases", "verification"):
        shutil.copytree(ROOT / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("command", [c for c in NEEDLEFEM if complete(c) and not too_long(c)])
def test_a_command_runs(command: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(shortened(shlex.split(command)[1:])) == 0
    assert capsys.readouterr().out


LONG = [c for c in NEEDLEFEM if complete(c) and too_long(c)]


def before(command: str) -> list[str]:
    """Return the command that writes what a command reads, if it reads a result."""
    read = shlex.split(command)[2]
    return [c for c in LONG if c.endswith(f"--out {read}")] if read.startswith("out/") else []


@pytest.mark.long
@pytest.mark.parametrize("command", [c for c in LONG if not elsewhere(c)])
def test_a_long_command_runs(command: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for line in (*before(command), command):
        # what a page changes by --set need not end as the case expects
        assert main(shlex.split(line)[1:]) in ((0, 1, 3) if " --set " in line else (0,))
    assert capsys.readouterr().out


@pytest.mark.parametrize("command", LONG)
def test_a_long_command_is_read(command: str, here: Path) -> None:
    options = parser_of().parse_args(shlex.split(command)[1:])
    for name in ("case", "on"):
        path = str(getattr(options, name, "") or "")
        if path.startswith("cases"):
            assert load_case(path).title
        known = options.command == "new" or not path or Path(path).exists()
        assert known or before(command)
    if options.command == "study":
        assert study(options.study)
    if options.command == "bench":
        assert benchmark(options.benchmark)


@pytest.mark.parametrize("command", [c for c in NEEDLEFEM if not complete(c)])
def test_a_name_is_known(command: str) -> None:
    name, *rest = command.split()[1:]
    known = {"study": study, "bench": benchmark}
    if rest and name in known:
        assert known[name](rest[0])
    elif name not in ("COMMAND", *known):
        assert f"needlefem {name}" in (ROOT / "docs" / "reference" / "commands.md").read_text()


def test_every_target_of_make_is_there() -> None:
    targets = {line.split()[1] for line in commands() if line.startswith("make ")}
    targets |= set(re.findall(r'echo "make ([a-z]+)', (ROOT / "Makefile").read_text()))
    assert len(targets) >= 10
    for target in sorted(targets):
        subprocess.run(["make", "-n", target], cwd=ROOT, check=True, capture_output=True)


def test_every_extra_is_there() -> None:
    lines = [line for line in commands() if line.startswith("pip install")]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = {name for line in lines for name in re.findall(r"\[(\w+)\]", line)}
    assert extras >= {"image", "render", "video"}
    assert extras <= set(project["optional-dependencies"])


def test_what_is_no_code_is_packaged() -> None:
    """A wheel has the files that the package reads."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    package = ROOT / "needlefem"
    packed = {p for glob in settings["package-data"]["needlefem"] for p in package.glob(glob)}
    other = {p for p in package.rglob("*") if p.is_file() and p.suffix not in (".py", ".pyc")}
    assert other == packed
    for folder in {path.parent for path in package.rglob("*.py")}:
        assert (folder / "__init__.py").exists(), folder


def test_scripts_are_there() -> None:
    scripts = [shlex.split(line) for line in commands() if line.startswith("python ")]
    assert all((ROOT / words[1]).exists() for words in scripts if "/" in words[1])
