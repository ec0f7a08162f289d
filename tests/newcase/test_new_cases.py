import json
import re
from pathlib import Path

import numpy as np
import pytest

from needlefem import load_case
from needlefem.cli.main import main
from needlefem.errors import CaseError
from needlefem.geometry import Contour
from needlefem.mesh import box, cell_measures, name_faces
from needlefem.newcase import box as boxes
from needlefem.scene import BoxMesh, FileMesh, build_mesh
from tests.image import maps
from tests.mesh.test_file import write as write_mesh

ANSWERS = {
    "youngs_modulus": "20 kPa", "poissons_ratio": "0.45", "faces": '["{face}"]',
    "cutting_force": "90 N/m", "shaft_friction": "5 kPa", "unit": "1 mm",
    "direction": "[0.0, 1.0]", "max_depth": "3 cm", "point": '["3 cm", "2 cm"]',
}  # fmt: skip


def answered(case: Path, face: str, most: int = 60) -> tuple[list[str], list[str]]:
    """Answer what is open, one key after another; return the keys, and --set for all."""
    asked: list[str] = []
    overrides: list[str] = []
    for _ in range(most):
        error = refusal(case, overrides)
        if error is None:
            return asked, overrides
        assert "'?' is still open" in str(error)
        assert "; write " in str(error)
        assert "\n" not in str(error)
        asked.append(error.key)
        answer = ANSWERS[error.key.split(".")[-1]].format(face=face)
        overrides.append(f"{error.key}={answer}")
    raise AssertionError(f"never done: {asked}")


def refusal(case: Path, overrides: list[str]) -> CaseError | None:
    try:
        load_case(case, overrides)
    except CaseError as error:
        return error
    return None


def test_contours(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "gland.csv").write_text("x [cm], d [cm]\n1, 1\n4, 1\n4, 3\n1, 3\n")
    (tmp_path / "node.csv").write_text("x [mm], d [mm]\n20, 15\n25, 15\n25, 22\n20, 22\n")
    files = [str(tmp_path / name) for name in ("node.csv", "gland.csv")]
    case = tmp_path / "new" / "case.toml"
    assert main(["new", str(case.parent), "--contour", *files, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["regions"] == ["gland", "node"]  # what encloses comes first: the later wins
    assert record["open"].startswith("materials.background.youngs_modulus: '?' is still open")
    asked, overrides = answered(case, "d_max")
    assert asked[-2:] == ["motion.max_depth", "target.point"]
    scene = load_case(case, overrides)
    assert scene.axes == ("x", "d")
    assert isinstance(scene.mesh, BoxMesh)
    assert scene.mesh.origin == pytest.approx((-0.005, -0.005))
    assert scene.mesh.size == pytest.approx((0.06, 0.05))
    mesh = build_mesh(scene)
    assert scene.mesh.interfaces == "fitted"
    areas = {name: mesh_area(mesh, cells) for name, cells in mesh.subdomains.items()}
    assert areas["node"] == pytest.approx(5e-3 * 7e-3, rel=0.1)
    assert areas["gland"] == pytest.approx(0.03 * 0.02 - 5e-3 * 7e-3, rel=0.02)


def test_a_corner_far_away_is_refused_before_a_mesh_is_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("needlefem.newcase.box.build_mesh", pytest.fail)
    corners = ["1, 1", "3, 1", "700, 2", "3, 3", "1, 3"]
    (tmp_path / "organ.csv").write_text("\n".join(["y [cm], z [cm]", *corners]) + "\n")
    (tmp_path / "node.csv").write_text("y [cm], z [cm]\n1.5, 1.5\n2, 1.5\n2, 2\n")
    files = [str(tmp_path / name) for name in ("node.csv", "organ.csv")]
    line = ["--target", "2, 1.5 cm", "--direction", "0, 1"]
    assert main(["new", str(tmp_path / "new"), "--contour", *files, *line]) == 2
    said = capsys.readouterr().err
    assert re.search(r"--contour: a mesh for the box of 7.02 x 0.05 m .* [0-9]+0,000 cells", said)
    assert "vertex, 3 of 'organ' at (7, 0.02) m" in said
    assert said.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_the_estimate_of_cells_is_near_those_of_the_mesh() -> None:
    turn = 2.0 * np.pi * np.arange(60) / 60
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    for radius, target in ((0.01, 0.02), (0.05, 0.1), (0.2, 0.3)):
        contours = {"organ": Contour(np.array([target, target]) + radius * circle)}
        box = boxes.box_around(contours, 0.015)
        point, direction = np.array([target, target]), np.array([0.0, 1.0])
        line = boxes.TargetLine(point, direction, box.depth_of(point, direction))
        box = boxes.with_room(box, line)
        sizes = boxes.contour_sizes(contours, 0.5e-3)
        draft = boxes.BoxDraft(box, sizes, "by_centroid", "", line)
        made = build_mesh(boxes._trial(draft, contours)).nelements
        estimate = boxes._cells(box, contours, sizes, line)
        assert 0.6 * made < estimate < 1.6 * made


def mesh_area(mesh: object, cells: np.ndarray) -> float:
    return float(cell_measures(mesh)[cells].sum())


def test_the_needle_of_a_contour(tmp_path: Path) -> None:
    (tmp_path / "gland.csv").write_text("y [cm], z [cm]\n1, 1\n4, 1\n4, 3\n1, 3\n")
    line = ["--target", "20, 15 mm", "--direction", "0, 2", "--margin", "1 cm"]
    assert main(["new", str(tmp_path), "--contour", str(tmp_path / "gland.csv"), *line]) == 0
    asked, overrides = answered(tmp_path / "case.toml", "z_max")
    assert not {"motion.direction", "motion.max_depth", "target.point"} & set(asked)
    scene = load_case(tmp_path / "case.toml", overrides)
    assert scene.motion.direction == (0.0, 1.0)
    assert scene.motion.max_depth == pytest.approx(0.023)  # half as deep again, in whole mm
    assert (tmp_path / "gland.csv").read_text().startswith("y [cm], z [cm]\n1, 1\n")  # as it was


def test_contours_that_come_near_are_not_fitted(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("y [cm], z [cm]\n1, 1\n4, 1\n4, 3\n1, 3\n")
    (tmp_path / "b.csv").write_text("y [cm], z [cm]\n4.1, 1\n6, 1\n6, 3\n4.1, 3\n")
    files = [str(tmp_path / name) for name in ("a.csv", "b.csv")]
    assert main(["new", str(tmp_path / "c"), "--contour", *files]) == 0
    text = (tmp_path / "c" / "case.toml").read_text()
    assert 'interfaces = "by_centroid"' in text
    assert "contours have a distance of 1 mm" in text


@pytest.mark.parametrize("name", ["square.msh", "square.vtu"])
def test_a_mesh_with_named_groups(tmp_path: Path, name: str) -> None:
    """Gmsh's physical groups, and VTU as scikit-fem writes it."""
    if name.endswith(".msh"):
        write_mesh(tmp_path / name)
    else:
        mesh = name_faces(box((0.0, 0.0), (60.0, 60.0), (20, 20)), ("y", "z"))
        middles = mesh.p[:, mesh.t].mean(axis=1)
        organ = np.flatnonzero(np.hypot(middles[0] - 30.0, middles[1] - 30.0) < 12.0)
        rest = np.setdiff1d(np.arange(mesh.nelements), organ)
        mesh.with_subdomains({"organ": organ, "rest": rest}).save(str(tmp_path / name))
    case = tmp_path / "new" / "case.toml"
    assert main(["new", str(case), "--mesh", str(tmp_path / name)]) == 0
    face = "walls" if name.endswith(".msh") else "z_max"
    asked, overrides = answered(case, face)
    assert asked[0] == "mesh.unit"
    assert "materials.organ.youngs_modulus" in asked
    scene = load_case(case, overrides)
    assert isinstance(scene.mesh, FileMesh)
    assert scene.default_material == "rest"
    assert build_mesh(scene).p.max() == pytest.approx(0.06)
    assert len(build_mesh(scene).subdomains["organ"]) > 0


def test_a_label_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = maps.write(tmp_path / "map.seg.nrrd")
    line = ["--target", "Tumour", "--direction", "0, 0.3, 1", "--space", "RAS"]
    assert main(["new", str(tmp_path / "c"), "--labelmap", str(path), *line]) == 0
    assert "regions: Prostate, Tumour" in capsys.readouterr().out
    asked, overrides = answered(tmp_path / "c" / "case.toml", "z_max")
    assert "materials.Prostate.youngs_modulus" not in asked  # known by its name
    scene = load_case(tmp_path / "c" / "case.toml", overrides)
    assert scene.frame is not None
    there = 1e3 * scene.frame.to_scanner(np.array(scene.target))
    assert there == pytest.approx(maps.CENTRE * [-1.0, -1.0, 1.0], abs=0.2)
    assert scene.frame.from_scanner(1e-3 * there) == pytest.approx(scene.target)
    entry = scene.frame.to_scanner(np.array([scene.target[0], 0.0]))
    edge = scene.frame.voxels.numbers(entry[None])[0]
    border = np.minimum(np.abs(edge + 0.5), np.abs(edge - np.array(maps.SIZE) + 0.5))
    assert border.min() == pytest.approx(0.0, abs=1e-6)  # the skin is where it enters the image


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("", "--target: missing; give a point ('12, -3.5, 40 mm') or a segment: Prostate, Tumour"),
        ("--target Tumor", "no segment 'Tumor'; did you mean 'Tumour'?"),
        ("--target Tumour", "--direction: missing; give a direction ('0, 0.2, 1')"),
        ("--target Tumour --direction 0,0,0", "'0,0,0' is not a direction"),
        ("--target 1,2,3 --direction 0,0,1", "'1,2,3' has no unit; write 3 numbers"),
        ("--target Tumour --direction 0,0,1 --segments prostate", "did you mean 'Prostate'?"),
        ("--target Tumour --entry 12,-31,70mm", "has no unit"),
        ("--target Tumour --direction 0,0,1 --margin -1_mm", "give a length above 0 and up to 1 m"),
        ("--target 12,-31,400_mm --direction 0,0,1", "(12, -31, 400) mm in LPS is outside the im"),
        ("--target 12,-31,74_mm --entry 12,-31,70_mm", "extends 1"),
        (
            "--target 45,-31,74_mm --direction 0,0,1 --across 0,1,0",
            "contains none of Prostate, Tumo",
        ),
    ],
)
def test_what_a_label_map_needs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: str, says: str
) -> None:
    path = maps.write(tmp_path / "map.seg.nrrd")
    line = [word.replace("_", " ") for word in re.split(" ", words)] if words else []
    assert main(["new", str(tmp_path / "c"), "--labelmap", str(path), *line]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
    assert not (tmp_path / "c").exists()


def test_nothing_is_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "case.toml").write_text("mine")
    (tmp_path / "gland.csv").write_text("y [cm], z [cm]\n1, 1\n4, 1\n4, 3\n1, 3\n")
    assert main(["new", str(tmp_path), "--contour", str(tmp_path / "gland.csv")]) == 2
    assert "is there already; give another folder" in capsys.readouterr().err
    assert (tmp_path / "case.toml").read_text() == "mine"


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("origin", '["1 mm", "2 mm"]', "frame.origin: 2 numbers; give 3"),
        ("axes", "[[1, 0, 0], [0.1, 1, 0]]", "frame.axes: .* unit vectors at right angles"),
        ("axes", "[[1, 0], [0, 1]]", "frame.axes: .* give 2 vectors of 3 numbers"),
        ("space", "RSA", "frame.space: 'RSA' is not known; one of LPS, RAS"),
    ],
)
def test_frames_that_can_not_be(tmp_path: Path, key: str, value: str, says: str) -> None:
    path = maps.write(tmp_path / "map.seg.nrrd")
    line = ["--target", "Tumour", "--direction", "0, 0.3, 1"]
    assert main(["new", str(tmp_path / "c"), "--labelmap", str(path), *line]) == 0
    _, overrides = answered(tmp_path / "c" / "case.toml", "z_max")
    with pytest.raises(CaseError, match=says):
        load_case(tmp_path / "c" / "case.toml", [*overrides, f"frame.{key}={value}"])


@pytest.mark.parametrize("place", [(22.3, 31.7), (9.4, 18.1)])
def test_a_small_lesion_beside_the_needle_is_found(
    tmp_path: Path, place: tuple[float, float]
) -> None:
    """It lies between the corners of the squares, which are ten times as large."""
    turn = 2.0 * np.pi * np.arange(24) / 24
    for name, centre, radius in (("gland", (18.0, 25.0), 20.0), ("lesion", place, 1.2)):
        corners = np.array(centre) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        rows = "\n".join(f"{y:.6f}, {z:.6f}" for y, z in corners)
        (tmp_path / f"{name}.csv").write_text(f"y [mm], z [mm]\n{rows}\n")
    files = [str(tmp_path / name) for name in ("gland.csv", "lesion.csv")]
    line = ["--target", "35, 25 mm", "--entry", "35, 0 mm"]
    assert main(["new", str(tmp_path / "c"), "--contour", *files, *line]) == 0
    _, overrides = answered(tmp_path / "c" / "case.toml", "z_max")
    scene = load_case(tmp_path / "c" / "case.toml", overrides)
    assert scene.mesh.interfaces == "fitted"
    mesh = build_mesh(scene)
    area = scene.regions["lesion"].contour.area
    assert mesh_area(mesh, mesh.subdomains["lesion"]) == pytest.approx(area, rel=0.15)
    assert mesh.nelements < 6000
