"""``needlefem new`` and ``needlefem upgrade``."""

import argparse
import os
from pathlib import Path

# every command imports this module for its options: what makes a case is imported when used
from needlefem import newcase
from needlefem._toml import brief, comment
from needlefem.casefile.load import load_case
from needlefem.cli.common import say, say_json
from needlefem.errors import CaseError
from needlefem.io.result_folder import write_text


def add(parser: argparse.ArgumentParser) -> None:
    """Add them to the command's parser."""
    parser.add_argument("case", metavar="CASE", help="folder of the new case, or its case.toml")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument(
        "--contour", nargs="+", metavar="FILE", help="contours as CSV, a region each"
    )
    source.add_argument("--labelmap", metavar="FILE", help="a .nrrd, .seg.nrrd or .nii.gz")
    source.add_argument("--mesh", metavar="FILE", help="a .msh or .vtu with named groups")
    parser.add_argument(
        "--target", default="", metavar="POINT",
        help="point to hit, as in '12, -3.5, 40 mm' (two numbers without a label map), "
        "or a segment: its centre",
    )  # fmt: skip
    line = parser.add_mutually_exclusive_group()
    line.add_argument(
        "--entry", default="", metavar="POINT", help="where the needle meets the skin"
    )
    line.add_argument(
        "--direction", default="", metavar="VECTOR", help="of the needle: '0, 0.2, 1'"
    )
    parser.add_argument(
        "--across", default="", metavar="VECTOR",
        help="what the plane contains beside the needle; a voxels' axis when left out",
    )  # fmt: skip
    parser.add_argument(
        "--space", choices=("LPS", "RAS"), default="LPS",
        help="of coordinates of a label map: LPS as in DICOM, RAS as 3D Slicer shows them",
    )  # fmt: skip
    parser.add_argument("--segments", default="", metavar="NAMES", help="those to take: 'a, b'")
    parser.add_argument("--margin", default="", metavar="LENGTH", help="of the box; 15 mm")
    parser.add_argument(
        "--unit", default="", metavar="LENGTH",
        help="one unit of the mesh file, or of contours whose headers name none",
    )  # fmt: skip


# ``needlefem new``.


def upgrade(options: argparse.Namespace) -> int:
    """Rewrite a case file with the words of schema version 2; return the exit status."""
    from needlefem.casefile.upgrade import upgrade_case  # noqa: PLC0415  (`new` needs none of it)

    path = Path(options.case)
    text, words = upgrade_case(path)
    write_text(path, text)
    if options.json:
        say_json({"case": str(path), "words": [word._asdict() for word in words]})
    else:
        say("\n".join([f"wrote {path}", *(f"  {word}" for word in words)]))
    return 0


def main(options: argparse.Namespace) -> int:
    """Begin a case from files, write it, say what is still open; return the exit status."""
    path = Path(options.case)
    case = path if path.suffix == ".toml" else path / "case.toml"
    draft = _draft(options, case.parent)
    written = _write(draft, case, {os.path.realpath(name) for name in options.contour or ()})
    try:
        load_case(case)
        left = ""
    except CaseError as error:
        left = str(error)
    regions = list(draft.names.values())
    record = {"case": str(case), "written": [str(p) for p in written], "regions": regions,
              "remarks": draft.remarks, "open": left or None}  # fmt: skip
    if options.json:
        say_json(record)
        return 0
    for file in written:
        say(f"wrote {file}")
    say(f"regions: {', '.join(map(brief, regions)) or 'none'}")
    for sentence in draft.remarks:
        say(f"  {comment(sentence)}")
    if left:
        say(f"still open: {left}")
    return 0


def _draft(options: argparse.Namespace, folder: Path) -> "newcase.Draft":
    wanted = newcase.CaseRequest(
        **{
            name: getattr(options, name)
            for name in ("target", "entry", "direction", "across", "space", "segments", "margin",
                         "unit")
            if getattr(options, name)
        }
    )  # fmt: skip
    if options.labelmap:
        return newcase.of_labelmap(Path(options.labelmap), wanted)
    for name in ("across", "segments", *(("entry",) if options.mesh else ())):
        if getattr(wanted, name):
            problem = f"'{getattr(wanted, name)}'"
            what = "contours and label maps" if name == "entry" else "--labelmap alone"
            raise CaseError(f"--{name}", problem, f"it goes with {what}: leave it out")
    if options.mesh:
        return newcase.of_mesh(Path(options.mesh), folder, wanted)
    return newcase.of_contours([Path(name) for name in options.contour], folder, wanted)


def _write(draft: "newcase.Draft", case: Path, own: set[str]) -> list[Path]:
    """Write contours and case, never over a file that is there; `own` ones may stay."""
    texts = {
        case.parent / name: newcase.csv_text(contour.points, draft.axes)
        for name, contour in draft.contours.items()
        if os.path.realpath(case.parent / name) not in own
    }
    texts[case] = newcase.case_text(draft)
    for path in texts:
        if path.exists():
            raise CaseError("CASE", f"'{path}' is there already", "give another folder")
    for path, text in texts.items():
        write_text(path, text)
    return list(texts)
