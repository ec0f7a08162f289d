"""Files are regular, bounded, and text in UTF-8, or refused in a sentence."""

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from needlefem._inputfile import LIMIT_VARIABLE, read_bytes, read_text, require_file
from needlefem.errors import CaseError


def _loop(path: Path) -> None:
    path.symlink_to(path)


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(str(path))


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda path: None, "there is no such file"),
        (lambda path: path.mkdir(), "is a folder"),
        (os.mkfifo, "is a named pipe"),
        (_socket, "is a socket"),
        (lambda path: path.symlink_to("/dev/zero"), "is a device"),
        (_loop, "symbolic links go in a circle"),
        (lambda path: path.symlink_to(path.parent / "gone"), "there is no such file"),
    ],
)
def test_only_regular_files_are_read(
    make: Callable[[Path], None], reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # names of sockets must be short
    make(Path("input"))
    for read in (require_file, read_bytes, read_text):
        with pytest.raises(CaseError, match=f"key: .*{reason}.*; give"):
            read("input", "key", remedy="give another")


@pytest.mark.parametrize("name", ["a\0b", "x" * 300, "file/below"])
def test_names_that_no_file_can_have_are_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CaseError, match="key"):
        require_file(tmp_path / name, "key")


def test_large_files_are_refused_with_the_figure_and_the_limit_can_be_raised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    large = tmp_path / "large"
    with large.open("wb") as file:
        file.truncate(65_000_000)  # sparse: takes no room
    with pytest.raises(
        CaseError, match=f"has 65 MB, more than the limit of 64 MB.*{LIMIT_VARIABLE}"
    ):
        read_text(large, "key")
    monkeypatch.setenv(LIMIT_VARIABLE, "70")
    with pytest.raises(CaseError, match="a NUL byte in line 1"):
        read_text(large, "key")
    monkeypatch.setenv(LIMIT_VARIABLE, "much")
    with pytest.raises(CaseError, match="'much' is not a size"):
        read_text(large, "key")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_utf8_is_read_with_and_without_a_mark(encoding: str, tmp_path: Path) -> None:
    file = tmp_path / "text"
    file.write_bytes("größe\r\nµm\rend".encode(encoding))
    assert read_text(file, "key") == "größe\nµm\nend"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("y [mm]\nä".encode("utf-16"), "is text in UTF-16"),
        ("y [mm]\nä".encode("utf-32"), "is text in UTF-32"),
        (b"\xfe\xff\0y", "is text in UTF-16"),
        ("ab\ny [mm]".encode("utf-16-le"), "a NUL byte in line 1"),
        ("one\ntwo ä".encode("latin-1"), "byte 0xe4 in line 2"),
        (b"\xef\xbb\xbfone\ntwo\nthree \xff", "byte 0xff in line 3"),
        (b"one\n\0", "a NUL byte in line 2"),
    ],
)
def test_other_encodings_are_refused(content: bytes, reason: str, tmp_path: Path) -> None:
    file = tmp_path / "text"
    file.write_bytes(content)
    with pytest.raises(CaseError, match=f"{reason}.*save it as text in UTF-8"):
        read_text(file, "key")
