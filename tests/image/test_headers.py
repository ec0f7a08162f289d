"""What headers say of voxels is read whole; what contradicts itself or is cut off is refused."""

import bz2
import gzip
import re
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import SimpleITK

from needlefem.errors import CaseError
from needlefem.image import LabelMap, Segment, read_labelmap
from needlefem.image.nifti import LAYOUT
from tests.image import maps

LABELS = (np.arange(2 * 3 * 4).reshape(2, 3, 4) % 5).astype(np.uint8)
"""Of the small files made here, shape (nk, nj, ni)."""
NRRD = {
    "type": "uint8", "dimension": "3", "space": "left-posterior-superior", "sizes": "4 3 2",
    "space directions": "(1,0,0) (0,2,0) (0,0,3)", "kinds": "domain domain domain",
    "encoding": "raw", "space origin": "(10,20,30)",
}  # fmt: skip
META = {
    "ObjectType": "Image", "NDims": "3", "BinaryData": "True", "BinaryDataByteOrderMSB": "False",
    "CompressedData": "False", "TransformMatrix": "1 0 0 0 1 0 0 0 1", "Offset": "10 20 30",
    "ElementSpacing": "1 2 3", "DimSize": "4 3 2", "ElementType": "MET_UCHAR",
    "ElementDataFile": "LOCAL",
}  # fmt: skip


def nrrd(path: Path, data: bytes = LABELS.tobytes(), keys: str = "", **changes: str) -> Path:
    """Write a NRRD; a change to '' leaves a field out, `_` in names is a blank."""
    fields = NRRD | {name.replace("_", " "): text for name, text in changes.items()}
    lines = [f"{name}: {text}" for name, text in fields.items() if text]
    own = [keys] if keys else []
    path.write_bytes("\n".join(["NRRD0005", *lines, *own]).encode() + b"\n\n" + data)
    return path


def meta(path: Path, data: bytes = LABELS.tobytes(), **changes: str) -> Path:
    """Write a MetaImage; a change to '' leaves a field out."""
    fields = {name: text for name, text in (META | changes).items() if text}
    last = fields.pop("ElementDataFile")
    lines = [*(f"{name} = {text}" for name, text in fields.items()), f"ElementDataFile = {last}"]
    path.write_bytes("\n".join(lines).encode() + b"\n" + data)
    return path


def nifti(path: Path, data: bytes = LABELS.tobytes(), **changes: tuple[float, ...]) -> Path:
    """Write a NIfTI-1 with an sform and a qform that agree."""
    said: dict[str, tuple[float, ...]] = {
        "dim": (3, 4, 3, 2, 1, 1, 1, 1), "datatype": (2,), "bitpix": (8,),
        "pixdim": (1, 1, 2, 3, 1, 1, 1, 1), "vox_offset": (352,), "scl_slope": (0,),
        "scl_inter": (0,), "xyzt_units": (2,), "qform_code": (1,), "sform_code": (1,),
        "quatern": (0, 0, 0), "qoffset": (10, 20, 30),
        "srow": (1, 0, 0, 10, 0, 2, 0, 20, 0, 0, 3, 30),
    }  # fmt: skip
    head = bytearray(352)
    struct.pack_into("<i", head, 0, 348)
    head[344:348] = b"n+1\0"
    for name, values in (said | changes).items():
        start, kind = LAYOUT[348][name]
        struct.pack_into("<" + kind, head, start, *values)
    path.write_bytes(bytes(head) + data)
    return path


def corner(found: LabelMap, number: tuple[int, int, int] = (3, 2, 1)) -> np.ndarray:
    """Return where a voxel is, mm."""
    return 1e3 * found.voxels.points(np.array([number], dtype=float))[0]


@pytest.mark.parametrize("kind", [np.uint8, np.int16, np.uint32, np.float32, np.float64])
@pytest.mark.parametrize(
    "name",
    ["a.nrrd", "z.nrrd", "a.nhdr", "a.nii", "a.nii.gz", "a.mha", "z.mha", "a.mhd", "a.hdr"],
)
@pytest.mark.parametrize("handed", [1.0, -1.0])
def test_values_and_places_are_those_of_simpleitk(
    tmp_path: Path, name: str, kind: type, handed: float
) -> None:
    image = SimpleITK.GetImageFromArray(LABELS.astype(kind))
    image.SetSpacing([0.7, 1.3, 2.9])
    image.SetOrigin([-12.5, 200.0, 31.0])
    turned = maps.turn((0.2, 1.0, -0.4), 0.6) @ np.diag([1.0, 1.0, handed])
    image.SetDirection(turned.ravel().tolist())
    SimpleITK.WriteImage(image, str(tmp_path / name), name.startswith("z"))
    found = read_labelmap(tmp_path / name)
    assert np.array_equal(found.labels[0], LABELS)
    there = image.TransformContinuousIndexToPhysicalPoint([3.0, 2.0, 1.0])
    assert corner(found) == pytest.approx(there, abs=1e-4)
    assert found.remarks == ()


def test_layers_and_names(tmp_path: Path) -> None:
    two = np.stack([LABELS > 0, LABELS > 2], axis=-1).astype(np.uint8)
    keys = "Segment0_Name:=a\nSegment0_Layer:=0\nSegment2_Name:=b\\\\\\n\nSegment2_Layer:=1"
    path = nrrd(
        tmp_path / "a.nrrd", two.tobytes(), keys, dimension="4", sizes="2 4 3 2",
        kinds="list domain domain domain", space_directions="none (1,0,0) (0,2,0) (0,0,3)",
    )  # fmt: skip
    found = read_labelmap(path)
    assert found.segments == (Segment("a", 1, 0), Segment("b\\", 1, 1))
    assert np.array_equal(found.mask(found.segments[1]), LABELS > 2)


def test_values_without_names_and_names_without_values(tmp_path: Path) -> None:
    keys = "Segment0_Name:=x\nSegment0_LabelValue:=1\nSegment1_Name:=y\nSegment1_LabelValue:=9"
    keys += "\nSegment3_Name:=x\nSegment3_LabelValue:=2"
    found = read_labelmap(nrrd(tmp_path / "a.nrrd", keys=keys))
    assert [s.name for s in found.segments] == ["x", "x 2", "label-3", "label-4"]
    assert found.remarks[0] == "Segment 'y' holds no voxel."
    assert "Value 3 of a.nrrd has no name there: it is called label-3." in found.remarks


@pytest.mark.parametrize(
    ("unit", "factor"), [("um", 1e-3), ("m", 1e3), ("mm", 1.0), ("µm", 1e-3), ("micrometer", 1e-3)]
)
def test_units_of_nrrd(tmp_path: Path, unit: str, factor: float) -> None:
    step = 1.0 / factor
    path = nrrd(
        tmp_path / "a.nrrd", space_units=f'"{unit}" "{unit}" "{unit}"',
        space_directions=f"({step},0,0) (0,{2 * step},0) (0,0,{3 * step})",
        space_origin=f"({10 * step},0,0)",
    )  # fmt: skip
    assert corner(read_labelmap(path)) == pytest.approx([13.0, 4.0, 3.0])


def test_units_of_the_other_formats(tmp_path: Path) -> None:
    metres = nifti(
        tmp_path / "a.nii", xyzt_units=(1,), pixdim=(1, 1e-3, 2e-3, 3e-3, 0, 0, 0, 0),
        srow=(1e-3, 0, 0, 0.01, 0, 2e-3, 0, 0.02, 0, 0, 3e-3, 0.03), qoffset=(0.01, 0.02, 0.03),
    )  # fmt: skip
    assert corner(read_labelmap(metres)) == pytest.approx([-13.0, -24.0, 33.0], rel=1e-6)
    centi = meta(
        tmp_path / "a.mha", DistanceUnits="cm", ElementSpacing="0.1 0.2 0.3", Offset="1 2 3"
    )
    assert corner(read_labelmap(centi)) == pytest.approx([13.0, 24.0, 33.0])


def test_spaces_of_nrrd(tmp_path: Path) -> None:
    ras = read_labelmap(nrrd(tmp_path / "a.nrrd", space="RAS"))
    assert corner(ras) == pytest.approx([-13.0, -24.0, 33.0])
    las = read_labelmap(nrrd(tmp_path / "b.nrrd", space="left-anterior-superior"))
    assert corner(las) == pytest.approx([13.0, -24.0, 33.0])


@pytest.mark.parametrize(
    ("file", "says"),
    [
        (lambda p: nrrd(p, space="", space_dimension="3"), "no 'space': that its axes are left"),
        (lambda p: nrrd(p, space="scanner-xyz"), "only 'scanner-xyz'"),
        (lambda p: nrrd(p, space_origin=""), r"no 'space origin': \(0, 0, 0\) is assumed"),
        (lambda p: nrrd(p, space="", space_directions="", space_origin="", spacings="1 2 3"),
         "no 'space'.*"),
        (lambda p: meta(p, TransformMatrix=""), "no TransformMatrix: that axes are left"),
        (lambda p: meta(p, Offset="", TransformMatrix=""), "no TransformMatrix and no Offset"),
        (lambda p: nifti(p, qform_code=(0,), sform_code=(0,)), "does not state the orientation"),
    ],
)  # fmt: skip
def test_what_headers_leave_out_is_said(tmp_path: Path, file: object, says: str) -> None:
    found = read_labelmap(file(tmp_path / "a"))
    assert re.search(says, found.remarks[0])
    assert np.array_equal(found.labels[0], LABELS)


def test_axis_mins_and_maxs_of_nrrd(tmp_path: Path) -> None:
    plain = {"space": "", "space_directions": "", "space_origin": "", "spacings": "1 2 3"}
    ends = {"axis_mins": "10 20 30", "axis_maxs": "14 26 36"}
    cells = read_labelmap(nrrd(tmp_path / "a.nrrd", **plain, **ends))
    assert corner(cells, (0, 0, 0)) == pytest.approx([10.5, 21.0, 31.5])
    with pytest.raises(CaseError, match="axis mins, axis maxs and spacings differ"):
        wrong = ends | {"axis_maxs": "14 26 40"}
        read_labelmap(nrrd(tmp_path / "b.nrrd", **plain, **wrong))


@pytest.mark.parametrize(
    ("encoding", "data"),
    [
        ("gzip", gzip.compress(LABELS.tobytes(), mtime=0)),
        ("bzip2", bz2.compress(LABELS.tobytes())),
        ("ascii", " ".join(str(n) for n in LABELS.ravel()).encode() + b"\n"),
        ("hex", LABELS.tobytes().hex().encode()),
        ("raw", LABELS.tobytes()),
    ],
    ids=["gzip", "bzip2", "ascii", "hex", "raw"],
)
def test_encodings_and_skips_of_nrrd(tmp_path: Path, encoding: str, data: bytes) -> None:
    attached = read_labelmap(nrrd(tmp_path / "a.nrrd", data, encoding=encoding))
    assert np.array_equal(attached.labels[0], LABELS)
    (tmp_path / "voxels").write_bytes(b"first line\nsecond\n" + data)
    header = nrrd(tmp_path / "a.nhdr", b"", encoding=encoding, data_file="voxels", line_skip="2")
    assert np.array_equal(read_labelmap(header).labels[0], LABELS)
    for cut in (data[: len(data) // 2], data[:-3] if encoding != "ascii" else data[:-4]):
        with pytest.raises(CaseError, match="end early|by its header there are|damaged"):
            read_labelmap(nrrd(tmp_path / "cut.nrrd", cut, encoding=encoding))
    if encoding in ("raw", "ascii", "hex"):
        more = data + (b"00" if encoding == "hex" else b"\1" if encoding == "raw" else b" 1")
        with pytest.raises(CaseError, match="by its header there are 24"):
            read_labelmap(nrrd(tmp_path / "more.nrrd", more, encoding=encoding))


def test_byte_orders_and_text_of_metaimage(tmp_path: Path) -> None:
    big = LABELS.astype(">i2").tobytes()
    kind = {"ElementType": "MET_SHORT", "BinaryDataByteOrderMSB": "True"}
    assert np.array_equal(read_labelmap(meta(tmp_path / "a.mha", big, **kind)).labels[0], LABELS)
    text = " ".join(str(n) for n in LABELS.ravel()).encode()
    plain = meta(tmp_path / "b.mha", text, BinaryData="False")
    assert np.array_equal(read_labelmap(plain).labels[0], LABELS)
    packed = zlib.compress(LABELS.tobytes())
    with pytest.raises(CaseError, match="zlib data end early"):
        read_labelmap(meta(tmp_path / "c.mha", packed[:-5], CompressedData="True"))


def test_a_qform_turns_as_an_sform(tmp_path: Path) -> None:
    """A quarter turn about the third axis, by its quaternion and by its matrix."""
    turn = {"quatern": (0.0, 0.0, np.sqrt(0.5)), "srow": (0, -2, 0, 10, 1, 0, 0, 20, 0, 0, 3, 30)}
    both = read_labelmap(nifti(tmp_path / "a.nii", **turn))
    for name in ("qform_code", "sform_code"):
        one = read_labelmap(nifti(tmp_path / "b.nii", **turn, **{name: (0,)}))
        assert corner(one) == pytest.approx(corner(both), abs=1e-5)
    assert corner(both) == pytest.approx([-(10.0 - 4.0), -(20.0 + 3.0), 33.0], abs=1e-5)
    left = read_labelmap(nifti(tmp_path / "c.nii", pixdim=(-1, 1, 2, 3, 1, 1, 1, 1),
                               sform_code=(0,)))  # fmt: skip
    assert corner(left) == pytest.approx([-13.0, -24.0, 27.0])


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"space_units": '"furlong" "mm" "mm"'}, "space units: 'furlong' is not a known unit"),
        (
            {"space_directions": "(1,0,0) (0,nan,0) (0,0,3)"},
            "space directions: 'nan' is not a finite",
        ),
        ({"space_directions": "(1,0,0) (0,0,0) (0,0,3)"}, "voxels of 1 x 0 x 3 mm"),
        ({"space_directions": "(1,0,0) (1,2,0) (0,0,3)"}, "not at right angles"),
        ({"space_directions": "(1e300,0,0) (0,2,0) (0,0,3)"}, "voxels of inf x"),
        ({"space_directions": "(1,0,0) (0,2,0)"}, "has not 3 entries"),
        ({"space_directions": "", "space_origin": ""}, "neither 'space directions' nor 'spacings'"),
        ({"space_directions": "", "spacings": "1 -2 3"}, "are not positive"),
        ({"spacings": "1 2 4"}, "spacings says 4, space directions 3"),
        ({"space_origin": "(1,inf,2)"}, "space origin: 'inf' is not a finite"),
        ({"space_origin": "(1_0,0,0)"}, "'1_0' is not a finite number"),
        ({"space_origin": "(1e9,0,0)"}, "first voxel is at"),
        ({"space": "right-up"}, "is not a known space with three axes"),
        ({"spave_origin": "(0,0,0)"}, "'spave origin' is not a field of a header; did you mean"),
        ({"sizes": "4 3 1000000"}, "bytes of voxels, by its header"),
        ({"sizes": "4 3 1000000000000"}, "are the most that is read"),
        ({"sizes": "4 3 -2"}, "sizes: '-2' is not an integer of at least 1"),
        ({"dimension": "4"}, "dimension says 4, sizes has 3"),
        ({"type": "block"}, "type: 'block' holds no labels"),
        ({"type": "short", "sizes": "4 3 1"}, "has no 'endian'"),
        ({"encoding": "zip"}, "encoding: 'zip' is not known"),
        ({"kinds": "RGB-color domain domain"}, "colours, vectors, time"),
        ({"kinds": "domain domain time"}, "colours, vectors, time"),
        ({"data_file": "LIST"}, "several files"),
        ({"data_file": "nowhere.raw"}, "nowhere.raw"),
        ({"encoding": "gzip"}, "gzip data are damaged"),
    ],
)  # fmt: skip
def test_refused_nrrd(tmp_path: Path, changes: dict[str, str], says: str) -> None:
    with pytest.raises(CaseError, match=says) as caught:
        read_labelmap(nrrd(tmp_path / "a.nrrd", **changes))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"srow": (1, 0, 0, 10, 0, 2, 0, 25, 0, 0, 3, 30)}, "sform and qform put voxels 5 apart"),
        ({"srow": (1.2, 0, 0, 10, 0, 2, 0, 20, 0, 0, 3, 30)}, "sform has voxels of 1.2 x 2 x 3, p"),
        ({"srow": (1, 0, 0, np.nan, 0, 2, 0, 20, 0, 0, 3, 30)}, "srow: .* is not finite"),
        ({"pixdim": (1, 1, np.inf, 3, 1, 1, 1, 1)}, "pixdim: .* is not finite"),
        ({"pixdim": (1, 1, -2, 3, 1, 1, 1, 1)}, "pixdim: .* are not valid voxel sizes"),
        ({"quatern": (1, 1, 0)}, "quatern_b, c, d: 1, 1, 0 are not a rotation"),
        ({"dim": (3, 4, 3, 0, 1, 1, 1, 1)}, "dim: .* are not valid sizes"),
        ({"dim": (4, 4, 3, 1, 2, 1, 1, 1)}, "several volumes"),
        ({"dim": (2, 4, 6, 1, 1, 1, 1, 1)}, "has 2 dimensions"),
        ({"dim": (3, 4, 3, 30, 1, 1, 1, 1)}, "has 24 bytes of voxels, by its header there are 360"),
        ({"datatype": (128,), "bitpix": (24,)}, "datatype: 128 holds colours"),
        ({"bitpix": (16,)}, "bitpix says 16, datatype 2 has 8"),
        ({"xyzt_units": (5,)}, "xyzt_units: 5 is not a unit"),
        ({"vox_offset": (np.nan,)}, "vox_offset: .* is not finite"),
        ({"vox_offset": (300,)}, "vox_offset: 300 lies in the header"),
        ({"scl_slope": (np.inf,)}, "scl_slope, scl_inter: inf"),
        ({"scl_slope": (0.3,)}, "which is not a label"),
        ({"qform_code": (77,)}, "qform_code: 77 is not known"),
    ],
)  # fmt: skip
def test_refused_nifti(tmp_path: Path, changes: dict[str, tuple[float, ...]], says: str) -> None:
    path = nifti(tmp_path / "a.nii", **changes)
    with pytest.raises(CaseError, match=says):
        read_labelmap(path)
    (tmp_path / "b.nii.gz").write_bytes(gzip.compress(path.read_bytes()))
    with pytest.raises(CaseError, match=says):
        read_labelmap(tmp_path / "b.nii.gz")


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"ElementSpacing": "1 2"}, "ElementSpacing: '1 2' has not 3 numbers"),
        ({"ElementSpacing": "1 0 3"}, "are not positive"),
        ({"ElementSpacing": ""}, "has no 'ElementSize'"),
        ({"TransformMatrix": "1 0 0 0 1 0 0 0 nan"}, "TransformMatrix: 'nan' is not a finite"),
        ({"TransformMatrix": "1 0 0 0 2 0 0 0 1"}, "no unit vectors"),
        ({"TransformMatrix": "1 0 0 1 0 0 0 0 1"}, "not at right angles"),
        ({"Position": "1 2 3"}, "Offset is given twice"),
        ({"DimSize": "4 3 3"}, "has 24 bytes of voxels, by its header there are 36"),
        ({"NDims": "2"}, "NDims says 2, DimSize has 3"),
        ({"ElementNumberOfChannels": "3"}, "ElementNumberOfChannels: 3: no labels"),
        ({"ElementType": "MET_UCHAR_ARRAY"}, "holds no labels"),
        ({"ElementDataFile": "LIST"}, "several files"),
        ({"CompressedData": "perhaps"}, "neither True nor False"),
        ({"DistanceUnits": "parsec"}, "'parsec' is not a known unit"),
    ],
)
def test_refused_metaimage(tmp_path: Path, changes: dict[str, str], says: str) -> None:
    with pytest.raises(CaseError, match=says):
        read_labelmap(meta(tmp_path / "a.mha", **changes))


def test_dicom_is_told_how_to_be_converted(tmp_path: Path) -> None:
    (tmp_path / "seg.dcm").write_bytes(b"\0" * 128 + b"DICM" + b"\0" * 100)
    with pytest.raises(CaseError, match="load it in 3D Slicer"):
        read_labelmap(tmp_path / "seg.dcm")
