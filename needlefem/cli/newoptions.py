"""The options of ``needlefem new``."""

import argparse


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
