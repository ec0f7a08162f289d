"""Files that are written completely or not at all, and folders with the result of one command."""

import errno
import itertools
import json
import math
import os
import re
import stat
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import TypeAlias

import numpy as np

from needlefem.errors import CaseError, OutputError

REASONS = {
    errno.ENOSPC: "no space is left there",
    errno.EDQUOT: "no space is left there",
    errno.EROFS: "the file system is read-only",
    errno.EACCES: "writing there is not permitted",
    errno.EPERM: "writing there is not permitted",
    errno.ENOTDIR: "a part of the path is a file, not a folder",
    errno.EEXIST: "a file of that name is there, not a folder",
    errno.EISDIR: "it is a folder",
    errno.ENAMETOOLONG: "the name is too long",
    errno.ELOOP: "its symbolic links go in a circle",
}
PART = re.compile(r"\.part-((?P<host>[A-Za-z0-9]*)-(?P<pid>\d+)-\d+|[a-z0-9_]{8})(\.\w+)?")
"""Names of files that are being written; without host and process: those of earlier versions."""
_HOST = re.sub(r"[^A-Za-z0-9]", "", os.uname().nodename if hasattr(os, "uname") else "")[:40]
_numbers = itertools.count()
_parts: set[Path] = set()


@contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Turn what the system says against writing a file into an `OutputError` with its path."""
    try:
        yield
    except OSError as error:
        reason = REASONS.get(error.errno or 0, (error.strerror or str(error)).lower())
        raise OutputError(f"can't write '{path}': {reason}") from error
    except ValueError as error:
        if "\0" not in str(path):
            raise
        raise OutputError(f"can't write {str(path)!r}: it is not a path") from error


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Give a temporary name beside `path`, and move the file there once the block succeeds.

    Raises
    ------
    OutputError
        The system does not let it be written.
    """
    path = Path(path)
    part = path.parent / f".part-{_HOST}-{os.getpid()}-{next(_numbers)}{path.suffix[:40]}"
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        _refuse_other_kinds(path)
        _parts.add(part)
        try:
            part.touch(exist_ok=False)
            yield part
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
            _parts.discard(part)


def _refuse_other_kinds(path: Path) -> None:
    """Refuse to replace a folder or a device; a link to nowhere is replaced."""
    if not path.exists():
        return
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, REASONS[errno.EISDIR])
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is not a regular file")


def probe(path: str | Path) -> None:
    """Find out whether a file can be written before its content is computed.

    What processes that were killed have left in its folder is removed.

    Raises
    ------
    OutputError
        It can't.
    """
    path = Path(path)
    made = [folder for folder in path.parents if not folder.exists()]
    part = path.with_name(f".part-{_HOST}-{os.getpid()}-{next(_numbers)}{path.suffix[:40]}")
    with writing(path):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            _refuse_other_kinds(path)
            part.write_bytes(bytes(4096))
        finally:
            with suppress(OSError):
                part.unlink()
            remove_parts(path.parent)
            for folder in made:
                with suppress(OSError):  # it could not be made, or has got a file since
                    folder.rmdir()


def remove_parts(folder: Path, *, locked: bool = False) -> None:
    """Remove what processes that were killed have left in a folder.

    Parameters
    ----------
    folder : Path
    locked : bool
        Nobody else writes there: then the parts of processes that seem to live go as well.
    """
    for path in folder.glob(".part-*"):
        found = PART.fullmatch(path.name)
        if found and path not in _parts and (locked or _left_over(found)):
            path.unlink(missing_ok=True)


def _left_over(part: re.Match[str]) -> bool:
    """Say whether a part is a dead process' of this machine."""
    if part["pid"] is None or part["host"] != _HOST or os.name != "posix":
        return False
    try:
        os.kill(int(part["pid"]), 0)
    except ProcessLookupError:
        return True
    except (PermissionError, OverflowError):
        return False
    return False


def discard_parts() -> None:
    """Remove what this process has begun to write, before it ends early."""
    for part in list(_parts):
        part.unlink(missing_ok=True)
        _parts.discard(part)


Json: TypeAlias = "bool | int | float | str | list[Json] | dict[str, Json] | None"


def to_json(record: object) -> str:
    """Return a record as JSON; arrays become lists, infinities and NaN become null."""
    return json.dumps(_plain(record), indent=2, allow_nan=False)


def _plain(value: object) -> Json:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def write_json(path: Path, record: object) -> None:
    """Write a record as JSON."""
    with whole_file(path) as part:
        part.write_text(to_json(record) + "\n", encoding="utf-8")


def write_text(path: Path, text: str) -> None:
    """Write a text."""
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8", errors="backslashreplace")


# The folder of a result: locked while it is written, without files of older results.
#
# Until the result is complete, a hidden file names the command. A result whose command was
# interrupted or is still running can therefore be recognised.


fcntl = import_module("fcntl") if os.name == "posix" else None
"""File locks; without them (on Windows) two simultaneous runs in one folder are not detected."""

MARK = ".needlefem.json"
"""File that says what is in a folder whose result is not complete."""
LOCK = ".needlefem.lock"
"""File that is locked by the process that writes; its content is the process' number."""
RUNNING, STOPPED = "running", "stopped"
INNER = ("insertion", "motion")
"""Folders for snapshots."""
PICTURE = r"(png|webp|jpg)"
FILES = {
    "run": (
        r"run\.json", r"(insertion|events|shaft)\.csv", rf"(forces|sticking)\.{PICTURE}",
        r"insertion\.pvd", r"insertion/\d{4,}(-objects)?\.vtu",
    ),
    "plan": (r"plan\.json", rf"(stages|depth|height)\.{PICTURE}"),
    "modes": (r"modes\.json", r"modes\.vtu", rf"modes\.{PICTURE}"),
    "motion": (r"motion\.json", r"motion\.csv", r"motion\.pvd", r"motion/\d{7,}\.vtu"),
    "verify": (r"verification\.(json|html)",),
}  # fmt: skip
"""Patterns of the files that a command writes, relative to its folder."""
TABLES = {"run": ("insertion", "events", "shaft"), "motion": ("motion",)}
"""Tables that every result of a command has, without ``.csv``."""
TOLD_BY = {
    "plan.json": ("plan", b'"release_point"'),
    "run.json": ("run", b'"puncture_depth"'),
    "modes.json": ("modes", b'"critical_steps"'),
    "motion.json": ("motion", b'"duration"'),
    "verification.json": ("verify", b'"problems"'),
    "insertion.csv": ("run", b"time [s],depth [m],speed [m/s],tip,"),
}
"""Files that tell a command's result, the command, and what files of other origin do not hold."""


class ResultFolder:
    """A folder that one command writes into; see `result_folder`."""

    def __init__(self, path: Path, command: str, key: str) -> None:
        self.path, self.command, self.key = path, command, key
        self.begun = False

    def begin(self) -> None:
        """Remove the files of an earlier result; from here on the folder is this command's.

        Raises
        ------
        CaseError
            A file with the name of one of this command's is there, but no result: it may be the
            user's own.
        OutputError
            The folder can't be written.
        """
        if self.begun:
            return
        old = ours(self.path, self.command)
        if old and held_by(self.path) is None:
            problem = f"'{self.path}' holds '{old[0]}', which is not a result of this command"
            raise CaseError(self.key, problem, "give another folder")
        self._mark(RUNNING)  # before anything is removed
        self.begun = True
        with writing(self.path):
            for name in old:
                (self.path / name).unlink(missing_ok=True)
            for place in INNER:
                with suppress(OSError):  # it is not there, or has files of the user's
                    (self.path / place).rmdir()

    def _mark(self, status: str) -> None:
        record = {"command": self.command, "status": status}
        write_text(self.path / MARK, json.dumps(record) + "\n")

    def end(self, *, complete: bool) -> None:
        """Let a result that was begun be taken for a whole one, or for one that is not."""
        if not self.begun:
            return
        if not complete:
            with suppress(OutputError):  # what stopped the command may be a full disk
                self._mark(STOPPED)
            return
        with writing(self.path):
            (self.path / MARK).unlink(missing_ok=True)


_open: dict[tuple[Path, int], ResultFolder] = {}
"""Folders that this process writes into, by path and thread."""


@contextmanager
def result_folder(path: str | Path, command: str, key: str = "--out") -> Iterator[ResultFolder]:
    """Make and lock a folder for the result of a command; its `begin` removes the earlier one.

    What writes within a command may ask for its folder again, and gets the same.

    Parameters
    ----------
    path : str or Path
    command : str
        A key of `FILES`.
    key : str
        Name of the option that gives the path, for messages.

    Raises
    ------
    CaseError
        Another process is writing there, or the folder holds the result of another command.
    OutputError
        The folder can't be made or written.
    """
    folder = Path(path)
    with writing(folder):
        made = [above for above in (folder, *folder.parents) if not above.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        own = folder.resolve(), threading.get_ident()
    if own in _open:
        yield _open[own]
        return
    try:
        with _locked(folder, key):
            held = held_by(folder)
            if held not in (None, command):
                problem = f"'{folder}' holds the result of '{held}'"
                raise CaseError(key, problem, "give another folder, or remove it")
            with writing(folder):
                for place in ("", *INNER):
                    remove_parts(folder / place, locked=True)
            found = _open[own] = ResultFolder(folder, command, key)
            try:
                yield found
            except BaseException:
                found.end(complete=False)
                raise
            finally:
                del _open[own]
            found.end(complete=True)
    finally:
        for above in made:  # nothing is left of a command that was refused
            with suppress(OSError):
                above.rmdir()


@contextmanager
def _locked(folder: Path, key: str) -> Iterator[None]:
    """Hold the folder's lock; the system drops it with the process, however that ends."""
    path = folder / LOCK
    while True:
        with writing(folder):
            file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _lock(file, folder, key)
            if _same(file, path):
                break
        except BaseException:
            os.close(file)
            raise
        os.close(file)  # its holder has removed it meanwhile
    try:
        with writing(folder):
            os.ftruncate(file, 0)
            os.write(file, f"{os.getpid()}\n".encode())
        yield
    finally:
        with suppress(OSError):
            path.unlink()
        os.close(file)


def _lock(file: int, folder: Path, key: str) -> None:
    if fcntl is None:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in (errno.EAGAIN, errno.EACCES, errno.EWOULDBLOCK):
            return  # a file system without locks
        who = os.pread(file, 20, 0).decode("ascii", "replace").strip()
        problem = f"process {who or 'of another command'} is writing into '{folder}'"
        raise CaseError(key, problem, "wait for it, or give another folder") from None


def _same(file: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file), path.stat())
    except FileNotFoundError:
        return False


def ours(folder: Path, command: str) -> list[str]:
    """Return the files of a folder that have the names of a command's, relative to it."""
    patterns = [re.compile(pattern) for pattern in FILES[command]]
    names = [path.relative_to(folder).as_posix() for path in _listed(folder)]
    return sorted(n for n in names if any(pattern.fullmatch(n) for pattern in patterns))


def _listed(folder: Path) -> Iterator[Path]:
    for path in folder.iterdir():
        if path.is_file() or path.is_symlink():
            yield path
        elif path.name in INNER and path.is_dir():
            yield from (inner for inner in path.iterdir() if inner.is_file())


def mark_of(folder: Path) -> dict[str, object] | None:
    """Return what the folder's hidden file says; None where there is none that can be read."""
    if not (folder / MARK).is_file():
        return None
    try:
        found = json.loads((folder / MARK).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def held_by(folder: Path) -> str | None:
    """Return the command whose result is in a folder, or None."""
    said = (mark_of(folder) or {}).get("command")
    if said in FILES:
        return str(said)
    for name, (command, key) in TOLD_BY.items():
        with suppress(OSError):
            if (folder / name).is_file() and key in (folder / name).read_bytes():
                return command
    return None
