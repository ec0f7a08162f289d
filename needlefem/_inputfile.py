"""Safe reading of the user's files: regular files of limited size, and text in UTF-8.

All readers of the package call these functions before they open a file. A named pipe or a device
such as ``/dev/zero`` would block or never end, and a library would not report the reason.
"""

import errno
import os
import stat
from pathlib import Path

from needlefem.errors import CaseError

LIMIT_VARIABLE = "NEEDLEFEM_LARGEST_FILE"
"""Environment variable with the largest size of a file, in megabytes."""
MEGABYTE = 1_000_000
LARGEST_TEXT = 64
"""Largest size of a text (a case, a contour, a table), megabytes."""
LARGEST_DATA = 4_000
"""Largest size of a mesh, a label map, an image or a result, megabytes."""
KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)
MARKS = (
    (b"\xff\xfe\x00\x00", "UTF-32"),
    (b"\x00\x00\xfe\xff", "UTF-32"),
    (b"\xff\xfe", "UTF-16"),
    (b"\xfe\xff", "UTF-16"),
)
"""Byte-order marks of encodings that are refused; UTF-32 first, as it begins like UTF-16."""
REASONS = {
    errno.ENOENT: "there is no such file",
    errno.ENOTDIR: "there is no such file",
    errno.EACCES: "reading it is not permitted",
    errno.EPERM: "reading it is not permitted",
    errno.ELOOP: "its symbolic links go in a circle",
    errno.ENAMETOOLONG: "the name is too long",
}


def require_file(
    path: str | Path, key: str, *, remedy: str = "give a file", largest: float = LARGEST_DATA
) -> Path:
    """Return the path of a file that exists, is regular, readable and not too large.

    Parameters
    ----------
    path : str or Path
    key : str
        Key or option of the path, for error messages.
    remedy : str
        Remedy in the error message.
    largest : float
        Limit of the size, megabytes; ``NEEDLEFEM_LARGEST_FILE`` in the environment replaces it.

    Raises
    ------
    CaseError
        The file does not exist, is a folder, a pipe, a device or a socket, can't be read, or is
        larger than the limit.
    """
    try:
        found = Path(path).stat()
    except OSError as error:
        raise _unreadable(path, key, error, remedy) from None
    except ValueError:  # a NUL in the name
        raise CaseError(key, f"{str(path)!r} is not a path", remedy) from None
    for is_kind, kind in KINDS:
        if is_kind(found.st_mode):
            raise CaseError(key, f"'{path}' is {kind}, not a file", remedy)
    if not os.access(path, os.R_OK):
        raise CaseError(key, f"can't read '{path}': {REASONS[errno.EACCES]}", remedy)
    limit = _limit(largest)
    if found.st_size > limit * MEGABYTE:
        size = found.st_size / MEGABYTE
        problem = f"'{path}' has {size:,.0f} MB, more than the limit of {limit:,.0f} MB"
        raise CaseError(key, problem, f"set {LIMIT_VARIABLE} (MB) in the environment to raise it")
    return Path(path)


def _limit(largest: float) -> float:
    said = os.environ.get(LIMIT_VARIABLE)
    if not said:
        return largest
    try:
        limit = float(said)
    except ValueError:
        limit = 0.0
    if not limit > 0.0:
        raise CaseError(LIMIT_VARIABLE, f"'{said}' is not a size", "write a number of megabytes")
    return limit


def _unreadable(path: str | Path, key: str, error: OSError, remedy: str) -> CaseError:
    reason = REASONS.get(error.errno or 0, (error.strerror or str(error)).lower())
    return CaseError(key, f"can't read '{path}': {reason}", remedy)


def read_bytes(
    path: str | Path, key: str, *, remedy: str = "give a file", largest: float = LARGEST_DATA
) -> bytes:
    """Return the content of a file; parameters and errors as for `require_file`."""
    file = require_file(path, key, remedy=remedy, largest=largest)
    try:
        return file.read_bytes()
    except OSError as error:
        raise _unreadable(path, key, error, remedy) from None


def read_text(
    path: str | Path, key: str, *, remedy: str = "give a text file", largest: float = LARGEST_TEXT
) -> str:
    r"""Return the text of a file in UTF-8, with or without a byte-order mark.

    Lines end in ``\n`` in what is returned, however they end in the file.

    Parameters
    ----------
    path : str or Path
    key : str
        Key or option of the path, for error messages.
    remedy : str
        Remedy in the error message if the file does not exist.
    largest : float
        Limit of the size, megabytes.

    Raises
    ------
    CaseError
        As for `require_file`; or the file has another encoding, or is no text.
    """
    return decode(read_bytes(path, key, remedy=remedy, largest=largest), path, key)


def decode(content: bytes, path: str | Path, key: str) -> str:
    """Return the bytes of a file in UTF-8 as text; see `read_text`."""
    remedy = "save it as text in UTF-8"
    for mark, encoding in MARKS:
        if content.startswith(mark):
            raise CaseError(key, f"'{path}' is text in {encoding}", remedy)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        at = error.start + len(content) - len(error.object)  # without the byte-order mark
        line = content.count(b"\n", 0, at) + 1
        problem = f"'{path}' is not in UTF-8 (byte 0x{content[at]:02x} in line {line})"
        raise CaseError(key, problem, remedy) from None
    nul = text.find("\0")
    if nul >= 0:
        line = text.count("\n", 0, nul) + 1
        problem = f"'{path}' is not text in UTF-8 (a NUL byte in line {line})"
        raise CaseError(key, problem, remedy)
    return text.replace("\r\n", "\n").replace("\r", "\n")
