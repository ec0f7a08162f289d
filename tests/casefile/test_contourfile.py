"""Contours are read as their headers say, or refused with the cause; never misread."""

from pathlib import Path

import numpy as np
import pytest

from needlefem.casefile import read_contour
from needlefem.cli.main import main
from needlefem.errors import CaseError

AXES = ("y", "z")
CORNERS = np.array([[0.0, 0.0], [0.0105, 0.0], [0.0105, 0.02], [0.0, 0.02]])
"""Not alike in y and z: a swap shows."""
ROWS = "0, 0\n10.5, 0\n10.5, 20\n0, 20\n"
SWAPPED = "0, 0\n0, 10.5\n20, 10.5\n20, 0\n"
SEMICOLONS = ROWS.replace(",", ";").replace(".", ",")


def written(folder: Path, text: str | bytes) -> Path:
    """Return a file with a content."""
    file = folder / "mine.csv"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


@pytest.mark.parametrize(
    "text",
    [
        "y [mm], z [mm]\n" + ROWS,
        "z [mm], y [mm]\n" + SWAPPED,
        "z (mm), y (mm)\n" + SWAPPED,
        "y_mm,z_mm\n" + ROWS,
        "y/mm, z/mm\n" + ROWS,
        "y mm, z in mm\n" + ROWS,
        "[mm], [mm]\n" + ROWS,
        "z [cm], y [mm]\n0, 0\n0, 10.5\n2, 10.5\n2, 0\n",
        "y [\u00b5m], z [\u03bcm]\n0, 0\n10500, 0\n1.05e4, 2e4\n0, 20000\n",
        '"y [mm]","z [mm]"\n"0","0"\n"10.5","0"\n10.5,"20"\n0,20\n',
        "y [mm];z [mm]\n" + ROWS.replace(",", ";"),
        "y [mm];z [mm]\n" + SEMICOLONS,
        "y [mm]\tz [mm]\n" + ROWS.replace(", ", "\t"),
        "\n# drawn by hand\ny [mm], z [mm]\n" + ROWS + "\n\n",
        "# y [mm], z [mm]\n" + ROWS,
        "# z [mm], y [mm]\n" + SWAPPED,
        ("y [mm], z [mm]\n" + ROWS).replace("\n", "\r\n"),
        ("y [mm], z [mm]\n" + ROWS).replace("\n", "\r"),
        ("y [mm], z [mm]\n" + ROWS).encode("utf-8-sig"),
        "y [mm], z [mm]\n" + ROWS + "0, 0\n",
        "y [mm], z [mm]\n0, 0\n0, 0\n10.5, 0\n10.5, 0\n10.5, 20\n0, 20\n0, 0\n0, 0\n",
        "y [mm], z [mm],\n" + ROWS.replace("\n", ",\n") + ",,\n,,\n",
        "y [mm], z [mm]\n" + ROWS[:-1],
    ],
)
def test_the_same_outline_is_read_however_it_is_written(text: str | bytes, tmp_path: Path) -> None:
    found = read_contour(written(tmp_path, text), "key", AXES)
    assert found.points == pytest.approx(CORNERS, abs=1e-15)


@pytest.mark.parametrize("text", [ROWS, SEMICOLONS, "y, z\n" + ROWS, "z, y\n" + SWAPPED])
def test_a_unit_beside_the_file_serves_where_the_header_has_none(text: str, tmp_path: Path) -> None:
    file = written(tmp_path, text)
    assert read_contour(file, "key", AXES, 1e-3).points == pytest.approx(CORNERS, abs=1e-15)
    with pytest.raises(CaseError, match="no unit of length in the header"):
        read_contour(file, "key", AXES)


def test_a_unit_that_contradicts_the_header_is_refused(tmp_path: Path) -> None:
    file = written(tmp_path, "y [mm], z [mm]\n" + ROWS)
    assert read_contour(file, "key", AXES, 1e-3).points == pytest.approx(CORNERS)
    with pytest.raises(CaseError, match="the header of 'mine.csv' says 0.001 m, unit 0.01 m"):
        read_contour(file, "key", AXES, 1e-2)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "is empty"),
        ("\n\n  \n", "is empty"),
        ("# nothing\n", "is empty"),
        ("y [mm], z [mm]\n", "has no corners"),
        ("x [mm], y [mm]\n" + ROWS, "names 'x', which is not an axis"),
        ("Y [mm], Z [mm]\n" + ROWS, "names 'Y', which is not an axis; known here: y, z"),
        ("y [mm], y [mm]\n" + ROWS, "names two columns alike"),
        ("y [mm], [mm]\n" + ROWS, "names some of the columns only"),
        ("y [mm], z\n" + ROWS, "no unit of length"),
        ("y [px], z [px]\n" + ROWS, "unknown unit 'px'"),
        ("y [mm], z [MM]\n" + ROWS, "unknown unit 'MM'"),
        ("y [kPa], z [kPa]\n" + ROWS, "unknown unit 'kPa'"),
        ("y [cm], z [cm], x [cm]\n1,1,1\n2,2,2\n", r"three columns \(y, z, x\)"),
        ("n,y [mm],z [mm]\n1,0,0\n2,1,0\n3,1,1\n", r"three columns \(n, y, z\)"),
        ("y [mm]\n1\n2\n3\n", "has one column"),
        ("y [mm], z [mm]\n0,0\n1,0\n1,1,1\n", "line 4 of 'mine.csv' is '1,1,1'; write 2 numbers"),
        ("y [mm], z [mm]\n0,0\n1\n1,1\n", "line 3 of 'mine.csv' is '1'"),
        ("y [mm], z [mm]\n0,0\n1;0\n1;1\n", "line 3 of 'mine.csv' is '1;0'"),
        ("y [mm], z [mm]\n1,5,0\n1,0\n1,1\n", "line 2 .*a decimal sign is a point"),
        ('y [mm], z [mm]\n"1,5","0"\n1,0\n1,1\n', "'1,5' with a decimal comma"),
        ("y [mm]\tz [mm]\n1,234\t0\n1\t0\n1\t1\n", "'1,234' with a decimal comma"),
        ("y [mm];z [mm]\n1,5;0.5\n1;0\n1;1\n", "another decimal sign"),
        ("y [mm];z [mm]\n1.234,5;0\n1;0\n1;1\n", "'1.234,5', which is not a number"),
        ("y [mm] z [mm]\n0 0\n1 0\n1 1\n", "has '0 0', which is not a number"),
        ("y [mm], z [mm]\n0,0\n1,nan\n1,1\n", "line 3 of 'mine.csv' has 'nan'"),
        ("y [mm], z [mm]\n0,0\n1,inf\n1,1\n", "has 'inf'"),
        ("y [mm], z [mm]\n0,0\n1,1e999\n1,1\n", "'1e999', which is too large"),
        ("y [mm], z [mm]\n0,0\n1,1_0\n1,1\n", "'1_0', which is not a number"),
        ("y [mm], z [mm]\n0,0\n1,\u0661\n1,1\n", "which is not a number"),
        ("y [mm], z [mm]\n0,0\n1," + "9" * 100_000 + "\n1,1\n", "line 3 .* has 100,002 characters"),
        ("y [mm], z [mm]\n0,0\n1," + "9" * 1_000 + "\n1,1\n", r"\(1,000 characters\)"),
        ('y [mm], z [mm]\n0,0\n1,"0\n1,1\n', "close the quotes"),
        ("1, x\n0,0\n1,0\n1,1\n", "'1,x', neither a header nor numbers"),
        ("y [mm], z [mm]\n0,0\n1,0\n0,0\n", "2 different corners in a row"),
        ("y [mm], z [mm]\n0,0\n1,1\n2,2\n", "lie on one line|crosses itself"),
        ("y [mm], z [mm]\n0,0\n1,1\n2,0\n2,2\n1,1\n0,2\n", "lines 3 and 6 .* the same corner"),
        ("y [mm], z [mm]\n0, 0\n1, 1\n1, 0\n0, 1\n", "crosses itself"),
        ("y [mm], z [mm]\n0,0\n1,0\0\n1,1\n", "a NUL byte in line 3"),
        (("y [mm], z [mm]\n" + ROWS).encode("utf-16"), "text in UTF-16"),
        ("y [mm], z [mm]\n# \u00e9\n".encode("latin-1"), "byte 0xe9 in line 2"),
    ],
)
def test_what_has_no_or_two_meanings_is_refused_with_the_cause(
    text: str | bytes, reason: str, tmp_path: Path
) -> None:
    with pytest.raises(CaseError, match=f"(?s)^key: .*({reason})") as caught:
        read_contour(written(tmp_path, text), "key", AXES)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


def test_new_takes_the_unit_of_files_that_say_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, ROWS)
    arguments = ["--contour", str(file), "--unit", "1 mm"]
    for case in (tmp_path, tmp_path / "elsewhere"):  # the file stays, and is written anew
        assert main(["new", str(case), *arguments]) == 0
        text = (case / "case.toml").read_text()
        assert ('unit = "1 mm"' in text) == (case == tmp_path)
        unit = 1e-3 if case == tmp_path else None
        found = read_contour(case / "mine.csv", "key", AXES, unit)
        assert found.points == pytest.approx(CORNERS)
    capsys.readouterr()
