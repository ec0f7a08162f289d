import sys
from pathlib import Path

import numpy as np
import pytest
import SimpleITK

from needlefem.errors import CaseError
from needlefem.image import Segment, read_labelmap
from needlefem.newcase.from_label_map import needle_plane, outlines
from tests.image import maps

HALF_A_VOXEL = 0.5 * maps.SPACING.min()


@pytest.mark.parametrize("name", ["map.nrrd", "map.seg.nrrd", "map.nii.gz", "map.mha"])
def test_orientation_is_kept(tmp_path: Path, name: str) -> None:
    found = read_labelmap(maps.write(tmp_path / name))
    made = maps.image(maps.inside(maps.PROSTATE).astype(np.uint8), {})
    numbers = np.array([[0.0, 0.0, 0.0], [89.0, 0.0, 3.25], [10.5, 60.0, 29.0]])
    there = [made.TransformContinuousIndexToPhysicalPoint(n.tolist()) for n in numbers]
    points = found.voxels.points(numbers)
    assert 1e3 * points == pytest.approx(np.array(there), abs=2e-4)
    assert found.voxels.numbers(points) == pytest.approx(numbers, abs=1e-9)


def test_names_are_kept_where_the_file_has_them(tmp_path: Path) -> None:
    named = read_labelmap(maps.write(tmp_path / "map.seg.nrrd"))
    assert named.segments == (Segment("Prostate", 1), Segment("Tumour", 2))
    plain = read_labelmap(maps.write(tmp_path / "map.nii.gz"))
    assert [segment.name for segment in plain.segments] == ["label-1", "label-2"]
    assert 1e3 * plain.centre(plain.segments[1]) == pytest.approx(maps.CENTRE, abs=0.1)


def test_segments_that_overlap_in_layers(tmp_path: Path) -> None:
    whole, part = maps.inside(maps.PROSTATE), maps.inside(maps.TUMOUR)
    labels = np.stack([whole, 3 * part], axis=-1).astype(np.uint8)
    path = tmp_path / "map.seg.nrrd"
    names = {"gland": (1, 0), "tumour": (3, 1)}
    SimpleITK.WriteImage(maps.image(labels, names), str(path), True)
    found = read_labelmap(path)
    assert found.segments == (Segment("gland", 1, 0), Segment("tumour", 3, 1))
    assert np.array_equal(found.mask(found.segments[0]), whole)
    assert np.array_equal(found.mask(found.segments[1]), part)


def test_ras_turns_the_first_two_axes(tmp_path: Path) -> None:
    path = maps.write(tmp_path / "map.seg.nrrd")
    lps, ras = read_labelmap(path), read_labelmap(path, "RAS")
    numbers = np.array([[3.0, 7.0, 11.0]])
    expected = lps.voxels.points(numbers) * [-1.0, -1.0, 1.0]
    assert ras.voxels.points(numbers) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("values", "says"),
    [
        (np.zeros((4, 4, 4), np.uint8), "contains no label other than 0"),
        (np.arange(512).reshape(8, 8, 8).astype(np.int16), "512 different values; give the segm"),
        (np.full((4, 4, 4), 0.25, np.float32), "holds 0.25, which is not a label"),
        (np.ones((4, 4), np.uint8), "has 2 dimensions"),
    ],
)
def test_what_is_no_label_map(tmp_path: Path, values: np.ndarray, says: str) -> None:
    path = tmp_path / "map.nrrd"
    SimpleITK.WriteImage(SimpleITK.GetImageFromArray(values), str(path))
    with pytest.raises(CaseError) as caught:
        read_labelmap(path)
    assert says in str(caught.value)


def test_files_that_can_not_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "map.nrrd").write_text("no image")
    with pytest.raises(CaseError, match=r"'map.nrrd': it does not begin as NRRD does"):
        read_labelmap(tmp_path / "map.nrrd")
    (tmp_path / "map.gipl").write_text("no image")
    with pytest.raises(CaseError, match=r"'map.gipl': can't be read as an image"):
        read_labelmap(tmp_path / "map.gipl")
    with pytest.raises(CaseError, match="--labelmap: can.t read"):
        read_labelmap(tmp_path / "other.nrrd")
    monkeypatch.setitem(sys.modules, "SimpleITK", None)
    with pytest.raises(CaseError, match=r"SimpleITK may read; pip install 'needlefem\[image\]'"):
        read_labelmap(tmp_path / "map.gipl")
    assert read_labelmap(maps.write(tmp_path / "own.nrrd")).segments  # our own formats need none


def test_outlines_lie_within_half_a_voxel_of_the_surface(tmp_path: Path) -> None:
    """Planes in any direction, through anywhere in the middle of the ellipsoid."""
    path = tmp_path / "map.nrrd"
    labels = maps.inside(maps.PROSTATE).astype(np.uint8)
    SimpleITK.WriteImage(maps.image(labels, {}), str(path), True)
    found, draw = read_labelmap(path), np.random.default_rng(7)
    for _ in range(12):
        target = 1e-3 * (maps.CENTRE + draw.uniform(-5.0, 5.0, 3))
        frame = needle_plane(found.voxels, "LPS", target, draw.normal(size=3))
        cut = outlines(found, found.segments[0], frame)
        assert (len(cut.contours), cut.dropped, cut.holes) == (1, 0, 0)
        away = maps.PROSTATE.distance(1e3 * frame.to_scanner(cut.contours[0].points))
        assert np.abs(away).max() <= HALF_A_VOXEL
        assert abs(away.mean()) < 0.1  # the filter does not shrink it


def test_parts_and_holes(tmp_path: Path) -> None:
    labels = np.zeros(tuple(maps.SIZE[::-1]), np.uint8)
    labels[5:25, 10:30, 10:50] = 1
    labels[5:25, 16:24, 22:38] = 0
    labels[5:25, 45:60, 10:50] = 1
    labels[15, 65, 80] = 1
    path = tmp_path / "map.nrrd"
    SimpleITK.WriteImage(maps.image(labels, {}), str(path))
    found = read_labelmap(path)
    middle = found.voxels.points(np.array([[30.0, 30.0, 15.0]]))[0]
    frame = needle_plane(found.voxels, "LPS", middle, np.array(found.voxels.axes[1]))
    assert frame.axes[0] == pytest.approx(found.voxels.axes[0])  # the finest at a right angle
    cut = outlines(found, found.segments[0], frame)
    sizes = [1e6 * contour.area for contour in cut.contours]
    assert sizes == pytest.approx([40 * 0.8 * 20 * 1.1, 40 * 0.8 * 15 * 1.1], rel=0.05)
    assert (cut.dropped, cut.holes) == (1, 1)


def test_a_plane_needs_two_directions(tmp_path: Path) -> None:
    voxels = read_labelmap(maps.write(tmp_path / "map.nrrd")).voxels
    up = np.array([0.0, 0.0, 1.0])
    with pytest.raises(CaseError, match="--across: .* is parallel to the needle"):
        needle_plane(voxels, "LPS", up, up, 2.0 * up)
    with pytest.raises(CaseError, match="--direction: .* has no length"):
        needle_plane(voxels, "LPS", up, 0.0 * up)
