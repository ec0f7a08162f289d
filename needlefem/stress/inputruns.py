"""One input with defects that a command reads, and the requirements on the command's response."""

import contextlib
import dataclasses
import os
import re
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from needlefem.errors import NeedlefemError
from needlefem.io.saved_result import load_result
from needlefem.stress.damage import CODE, PATHS, damage
from needlefem.stress.inputfiles import KINDS, CommandLine, has_label_maps, sound_input
from needlefem.stress.scenes import Fault

MOST_LINES, MOST_CHARACTERS = 2, 800
"""Largest number of lines or characters of a message."""
STATUSES = (0, 1, 2, 3, 4)
PACKAGE = Path(__file__).parents[1]
CANARY = CODE.partition(":")[0]
FOREIGN = re.compile(r"Warning:|^\s*File \"|vtk[A-Z]|kwarg |ERROR|Error:|HDF5")
"""Texts in messages of dependencies, which must not reach the user."""
PROGRESS = re.compile(r"needlefem \w+: \d+ s")
"""Beginnings of progress messages, which are no error messages."""
CACHES = (str(Path.home() / ".config"), str(Path.home() / ".cache"))
"""Folders in which dependencies store information about the machine."""
HELPERS = (sys.executable, "xset")
"""Programs that the renderer starts in a separate process."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class InputRun:
    """Result of one input with defects.

    Parameters
    ----------
    number : int
    kinds : dict
        Kind of the input, and the command that read it.
    damage : str
        Description of the defects.
    command : str
        Command with its arguments.
    status : str
        Exit status, or ``lost`` if there was no response.
    message : str
        Text on standard error.
    faults : tuple of Fault
    seconds : float
        Processor time.
    """

    number: int
    kinds: dict[str, str]
    damage: str
    command: str
    status: str
    message: str
    faults: tuple[Fault, ...]
    seconds: float = 0.0


@dataclasses.dataclass(frozen=True)
class Drawn:
    """An input with defects in a folder: kind, defects, and arguments of the command."""

    kind: str
    damage: str
    arguments: tuple[str, ...]


def draw_input(seed: int, number: int, folder: Path, results: Path) -> Drawn:
    """Write an input with defects into a folder.

    Parameters
    ----------
    seed, number : int
    folder : Path
        Existing folder; results are written to its neighbour ``out``.
    results : Path
        Result of `needlefem.stress.inputfiles.make_results`.
    """
    random = np.random.default_rng([seed, number])
    shares = {kind: share for kind, share in KINDS.items() if kind != "label map"}
    if has_label_maps():
        shares = KINDS
    weights = np.array(list(shares.values()))
    kind = str(random.choice(list(shares), p=weights / weights.sum()))
    sound = sound_input(random, kind, folder, results)
    (folder / f"{CANARY}.py").write_text(
        "from pathlib import Path\nPath('code-was-run').write_text('')\n", encoding="utf-8"
    )
    (folder / "folder").mkdir()
    os.mkfifo(folder / "fifo")
    (folder / "loop").symlink_to("loop")
    (folder / "link.csv").symlink_to("/etc/passwd")
    done = damage(random, folder, sound.damaged)
    arguments = sound.commands[int(random.integers(len(sound.commands)))]
    if random.random() < 0.03:  # the output folder may be invalid, too
        wrong = str(random.choice(["case.toml", "/dev/null", "x" * 300, "folder/../fifo"]))
        arguments = tuple(a.replace("{out}", wrong) for a in arguments)
    if arguments[0] in ("run", "plan", "render") and random.random() < 0.05:
        value = str(random.choice([*PATHS, "1 cm", "", "=", "[1", "nan"]))
        key = str(
            random.choice(["motion.max_depth", "mesh", "regions.organ.contour", "a.b.c", "."])
        )
        arguments = (*arguments, "--set", f"{key}={value}".replace("\x00", ""))
    return Drawn(kind, done, arguments)


def run_input(command_line: CommandLine, results: str, seed: int, number: int) -> InputRun:
    """Draw an input, run its command, and check the requirements."""
    with tempfile.TemporaryDirectory(prefix="needlefem-stress-") as name:
        return check_input(command_line, Path(results), seed, number, Path(name))


def check_input(
    command_line: CommandLine, results: Path, seed: int, number: int, folder: Path
) -> InputRun:
    """Draw an input into the folder ``in`` of a folder, run its command, and check."""
    given, out = folder / "in", folder / "out"
    given.mkdir(parents=True, exist_ok=True)
    drawn = draw_input(seed, number, given, results)
    arguments = [argument.replace("{out}", str(out)) for argument in drawn.arguments]
    before = _tree_of(given)
    begun = time.process_time()
    said = _run(command_line, arguments, folder)
    seconds = time.process_time() - begun
    after = _tree_of(given)
    faults = list(_faults(said, folder))
    changed = sorted(name for name in before.keys() | after.keys()
                     if before.get(name) != after.get(name))  # fmt: skip
    if changed and not _asked_for(changed, drawn.arguments):
        detail = f"changed beside the results: {', '.join(changed)[:200]}"
        faults.append(Fault(requirement="no file outside --out", detail=detail))
    return InputRun(
        number=number,
        kinds={"input": drawn.kind, "command": arguments[0]},
        damage=drawn.damage,
        command=" ".join(["needlefem", *(a.replace(str(out), "OUT") for a in arguments)]),
        status=str(said.status),
        message=said.errors,
        faults=tuple(faults),
        seconds=seconds,
    )


def _asked_for(changed: Sequence[str], arguments: Sequence[str]) -> bool:
    """Return whether files were written to the place of a random ``--out`` in the folder."""
    if "--out" not in arguments:
        return False
    wanted = arguments[arguments.index("--out") + 1]
    return "{out}" not in wanted and all(name.startswith(wanted) for name in changed)


def _tree_of(folder: Path) -> dict[str, tuple[int, int]]:
    """Return size and modification time of all files in a folder."""
    found = {}
    for path in folder.rglob("*"):
        about = path.lstat()
        if not path.is_dir():
            found[str(path.relative_to(folder))] = (about.st_size, about.st_mtime_ns)
    return found


@dataclasses.dataclass
class _Said:
    """Result of a command: exit status, output, warnings, traceback, written files."""

    status: int | str = ""
    output: str = ""
    errors: str = ""
    trace: str = ""
    written: list[str] = dataclasses.field(default_factory=list)


def _run(command_line: CommandLine, arguments: Sequence[str], folder: Path) -> _Said:
    """Run a command in this process in a folder, with its output in files."""
    said = _Said()
    temporary = folder / "tmp"
    temporary.mkdir(exist_ok=True)
    _WATCH.written = said.written
    os.environ["TMPDIR"] = str(temporary)
    tempfile.tempdir = None
    sys.dont_write_bytecode = True
    sys.modules.pop(CANARY, None)
    _watch_files()
    with contextlib.chdir(folder / "in"), _captured(folder) as caught:
        sys.path.insert(0, str(folder / "in"))
        _WATCH.allowed = (str(folder / "out"), str(temporary), *_wanted(arguments), *CACHES)
        try:
            said.status = _command(command_line, arguments)
        except SystemExit as end:
            said.status = end.code if isinstance(end.code, int) else 1
        except Exception:
            said.status, said.trace = "traceback", traceback.format_exc()
        finally:
            sys.path.remove(str(folder / "in"))
            _WATCH.allowed = None
            tempfile.tempdir = None
            del os.environ["TMPDIR"]
    said.output, said.errors = caught
    return said


def _wanted(arguments: Sequence[str]) -> list[str]:
    """Return the output path in the arguments, which need not be writable.

    A picture is written beside its place first.
    """
    if arguments[0] == "new":
        return [os.path.abspath(arguments[1])]  # noqa: PTH100  (no links)
    if "--out" not in arguments:
        return []
    place = os.path.abspath(arguments[arguments.index("--out") + 1])  # noqa: PTH100  (no links)
    return [str(Path(place).parent)] if arguments[0] == "render" else [place]


def _command(command_line: CommandLine, arguments: Sequence[str]) -> int:
    """Run a command, or ``load_result`` as in a script."""
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        warnings.simplefilter("ignore", DeprecationWarning)
        warnings.showwarning = _show_warning
        if arguments[0] != "load_result":
            return command_line(arguments)
        try:
            load_result(arguments[1])
        except NeedlefemError as error:
            sys.stderr.write(f"needlefem: {error}\n")
            return error.exit_status
    return 0


def _show_warning(  # noqa: PLR0917  (as Python calls it)
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,  # noqa: ARG001
    line: str | None = None,  # noqa: ARG001
) -> None:
    """Print a warning of the package like the command line, others like Python.

    A dependency that has turned warnings to another form or place must not hide its own.
    """
    if Path(filename).is_relative_to(PACKAGE):
        sys.stderr.write(f"needlefem: warning: {message}\n")
    else:
        sys.stderr.write(f"{filename}:{lineno}: {category.__name__}: {message}\n")


@contextlib.contextmanager
def _captured(folder: Path) -> Iterator[list[str]]:
    """Redirect the output of the process, C libraries included, to files; return their texts."""
    caught: list[str] = []
    files = [folder / "output.txt", folder / "errors.txt"]
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(0), os.dup(1), os.dup(2)]
    opened = [os.open(os.devnull, os.O_RDONLY)]
    opened += [os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC) for file in files]
    for number, handle in enumerate(opened):
        os.dup2(handle, number)
        os.close(handle)
    streams = sys.stdout, sys.stderr
    sys.stdout = os.fdopen(1, "w", encoding="utf-8", closefd=False)
    sys.stderr = os.fdopen(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)
    try:
        yield caught
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        sys.stdout, sys.stderr = streams
        for number, handle in enumerate(kept):
            os.dup2(handle, number)
            os.close(handle)
        caught += [file.read_text(encoding="utf-8", errors="replace") for file in files]


class _Watch:
    """Files that the process opens for writing outside of the allowed folders."""

    allowed: tuple[str, ...] | None = None
    written: list[str]
    running = False


_WATCH = _Watch()
_CHANGES = (
    "os.mkdir",
    "os.remove",
    "os.rmdir",
    "os.rename",
    "os.link",
    "os.symlink",
    "os.truncate",
)
_WRITE = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


def _watch_files() -> None:
    """Install the audit hook; Python can't remove it."""
    if not _WATCH.running:
        _WATCH.running = True
        sys.addaudithook(_audit)


def _audit(event: str, arguments: tuple[object, ...]) -> None:
    allowed = _WATCH.allowed
    if allowed is None:
        return
    writes = event == "open" and isinstance(arguments[2], int) and arguments[2] & _WRITE
    path = arguments[0] if writes or event in _CHANGES else None
    if isinstance(path, bytes):
        path = os.fsdecode(path)
    if isinstance(path, str | os.PathLike):
        full = os.path.abspath(path)  # noqa: PTH100  (links are not to be followed)
        inside = any(full == folder or full.startswith(folder + os.sep) for folder in allowed)
        if not inside and full != os.devnull:
            _WATCH.written.append(full)
    elif event == "subprocess.Popen" and arguments[0] in HELPERS:
        return
    elif event in ("os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect"):
        _WATCH.written.append(f"{event} {arguments[:2]}")


def _faults(said: _Said, folder: Path) -> Iterator[Fault]:
    """Yield the violated requirements."""
    if said.trace:
        yield Fault(requirement="no traceback", detail=said.trace)
    elif "Traceback (most recent call last)" in said.errors + said.output:
        yield Fault(requirement="no traceback", detail=said.errors[-3000:])
    elif said.status not in STATUSES:
        yield Fault(requirement="a known exit status", detail=f"status {said.status}")
    if not said.trace:
        yield from _message_faults(said)
    if (folder / "in" / "code-was-run").exists() or CANARY in sys.modules:
        yield Fault(requirement="no code run", detail=f"{CANARY} was imported")
    if said.written:
        detail = ", ".join(dict.fromkeys(said.written))[:300]
        yield Fault(requirement="no file outside --out", detail=detail)
    parts = [path.name for path in (folder / "out").rglob("*") if ".part" in path.name]
    if parts:
        yield Fault(requirement="no file half written", detail=", ".join(parts))


def _message_faults(said: _Said) -> Iterator[Fault]:
    """Yield the faults of the lines on standard error; usage texts of argparse may be longer."""
    lines = said.errors.splitlines()
    told = [line for line in lines if not line.startswith("warning:") and not PROGRESS.match(line)]
    if told and told[0].startswith("usage:"):
        return
    text = "\n".join(told)
    if len(told) > MOST_LINES or len(text) > MOST_CHARACTERS:
        detail = f"{len(told)} lines, {len(text)} characters: {text[:300]}"
        yield Fault(requirement="two lines", detail=detail)
    elif said.status not in (0, 1) and not text and not said.output:
        yield Fault(requirement="a message", detail=f"none with status {said.status}")
    odd = [
        line
        for line in (*told, *said.output.splitlines())
        if FOREIGN.search(line) and not line.startswith("needlefem:")
    ]
    if odd:
        yield Fault(requirement="no lines of dependencies", detail="\n".join(odd[:5])[:600])
