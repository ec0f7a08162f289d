"""Files that are whole or not there."""

import errno
import itertools
import json
import math
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from needlefem.errors import OutputError

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
        raise OutputError(f"can't write {str(path)!r}: it is no path") from error


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
        raise OSError(errno.EINVAL, "it is no regular file")


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


def to_json(record: Any) -> str:
    """Return a record as JSON; arrays become lists, infinities and NaN become null."""
    return json.dumps(_plain(record), indent=2, allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def write_json(path: Path, record: Any) -> None:
    """Write a record as JSON."""
    with whole_file(path) as part:
        part.write_text(to_json(record) + "\n", encoding="utf-8")


def write_text(path: Path, text: str) -> None:
    """Write a text."""
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8", errors="backslashreplace")
