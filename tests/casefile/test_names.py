"""Any text names a region, a material or a file's source; what is written can be read again."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from needlefem import load_case
from needlefem._toml import assignment, comment, dotted_key, key_of, key_parts, quoted
from needlefem.cli.main import main
from needlefem.errors import CaseError
from needlefem.newcase.draft import RESERVED, file_names, region_names
from needlefem.scene import build_mesh, field_of, vary
from tests.newcase.test_new_cases import answered

ODD = [
    "?", "background", "Background", "con", "CON", "../x", "/etc/passwd", "", " ", "Node", "node",
    "nöde", "n\u00f6de", "a.b", 'say "so"', "it's", "two\nlines", "back\\slash", "a=b", "[x]", "#",
    "肝臓", "tab\there", "x" * 3000, "x" * 3000 + "y", "case", "nul.csv", "\u2028", "\x7f",
]  # fmt: skip
"""Names of segments, contours and groups that have more than one meaning somewhere."""


def random_texts(count: int) -> list[str]:
    """Return texts of any characters, among them those that TOML and shells read."""
    draw = np.random.default_rng(16)
    points = [*range(0x20), *b"\"'\\=#[]{}.,?/ \x7f", 0x85, 0xA0, 0x2028, 0xFEFF, 0x1F600, 0xDC80]
    texts = []
    for _ in range(count):
        any_of = draw.integers(0, 0x10FFFF, 3).tolist()
        chosen = draw.choice([*points, *any_of, *map(ord, "abcXYZ019")], draw.integers(0, 12))
        texts.append("".join(chr(int(point)) for point in chosen))
    return texts


def told(text: str) -> str:
    """Return a text as a file in UTF-8 can hold it."""
    return "".join("\ufffd" if 0xD800 <= ord(c) < 0xE000 else c for c in text)


def test_every_text_is_read_again() -> None:
    for text in [*ODD, *random_texts(3000)]:
        written = f"# {comment(text)}\n{key_of(text)} = {quoted(text)}\n[a.{key_of(text)}]\nb = 1\n"
        if told(text) == "a":
            continue
        found = tomllib.loads(written.encode("utf-8", "strict").decode())
        assert found[told(text)] == told(text)
        assert found["a"] == {told(text): {"b": 1}}


def test_keys_of_set() -> None:
    for text in [*ODD, *random_texts(500)]:
        parts = ["materials", told(text), "density"]
        key = dotted_key(parts)
        assert key_parts(key) == parts
        assert assignment(f"{key} = 1 kg/m^3") == (key, "1 kg/m^3")
    assert key_parts("materials.My organ.density") == ["materials", "My organ", "density"]
    assert key_parts("a.b = 1\nc") == ["a", "b = 1\nc"]
    assert assignment("a") is None


def test_regions_and_files_are_distinct() -> None:
    names = list(dict.fromkeys([*ODD, *random_texts(300)]))
    regions = region_names(names, "background")
    assert len(set(regions.values())) == len(names)
    assert not {"background", "?", ""} & set(regions.values())
    files = file_names(regions.values(), taken=["Node.csv"])
    assert len({file.casefold() for file in files.values()} - {"node.csv"}) == len(names)
    for file in files.values():
        assert file.isascii()
        assert len(file) < 60
        assert not RESERVED.fullmatch(file.removesuffix(".csv"))
        assert file == Path(file).name


def write_map(path: Path, names: list[str]) -> None:
    """Write a grid of cubes, one for every name, as 3D Slicer does."""
    labels = np.zeros((6, 12 * ((len(names) + 5) // 6), 72), np.uint8)
    lines = ["NRRD0005", "type: uint8", "dimension: 3", "space: LPS",
             f"sizes: {' '.join(str(n) for n in reversed(labels.shape))}",
             "space directions: (1,0,0) (0,1,0) (0,0,1)", "space origin: (0,0,0)",
             "encoding: raw"]  # fmt: skip
    for number, name in enumerate(names):
        row, column = divmod(number, 6)
        labels[:, 12 * row + 3 : 12 * row + 9, 12 * column + 3 : 12 * column + 9] = number + 1
        written = name.replace("\\", "\\\\").replace("\n", "\\n")
        lines += [f"Segment{number}_Name:={written}", f"Segment{number}_LabelValue:={number + 1}"]
    path.write_bytes("\n".join(lines).encode() + b"\n\n" + labels.tobytes())


def test_segments_with_any_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_map(tmp_path / "map.seg.nrrd", ODD)
    case = tmp_path / "c" / "case.toml"
    line = ["--target", "36, 20, 3 mm", "--direction", "0, 1, 0", "--across", "1, 0, 0"]
    arguments = ["new", str(case.parent), "--labelmap", str(tmp_path / "map.seg.nrrd"), *line]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert all(text.isprintable() for text in printed.splitlines())
    data = tomllib.loads(case.read_text(encoding="utf-8"))
    assert len(data["regions"]) == len(ODD)
    assert len(data["materials"]) == len(ODD) + 1
    assert {region["material"] for region in data["regions"].values()} == set(data["regions"])
    files = {region["contour"] for region in data["regions"].values()}
    assert len({file.casefold() for file in files}) == len(ODD)
    assert {path.name for path in case.parent.iterdir()} == files | {"case.toml"}
    for name in data["materials"]:
        data["materials"][name] = {}
    overrides = [
        f"materials.{key_of(name)}={{youngs_modulus = '20 kPa', poissons_ratio = 0.4}}"
        for name in data["materials"]
    ]
    rest = ["supports.held.faces=['z_max']", "needle.cutting_force=90 N/m",
            "needle.shaft_friction=5 kPa", "mesh.interfaces=by_centroid"]  # fmt: skip
    scene = load_case(case, overrides + rest)
    mesh = build_mesh(scene)
    assert set(mesh.subdomains) == {"background", *scene.regions}
    assert min(len(cells) for cells in mesh.subdomains.values()) > 0


def test_contour_files_with_any_name(tmp_path: Path) -> None:
    names = ["?.csv", "background.csv", "Node.csv", "node.csv", "con.csv", "a.b.csv", "ö ü.csv",
             "say 'so'.csv", "q\"q.csv"]  # fmt: skip
    files = []
    for number, name in enumerate(names):
        low = 20 * number
        text = f"y [mm], z [mm]\n{low}, 0\n{low + 10}, 0\n{low + 10}, 10\n{low}, 10\n"
        (tmp_path / name).write_text(text)
        files.append(str(tmp_path / name))
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "node.csv").write_text("y [mm], z [mm]\n0, 20\n9, 20\n9, 29\n0, 29\n")
    files.append(str(tmp_path / "other" / "node.csv"))
    case = tmp_path / "c" / "case.toml"
    assert main(["new", str(case.parent), "--contour", *files]) == 0
    _, overrides = answered(case, "z_max")
    scene = load_case(case, overrides)
    assert len(scene.regions) == len(files)
    assert {"node", "node 2", "Node", "(?)", "background 2"} <= set(scene.regions)
    assert len({path.name.casefold() for path in case.parent.iterdir()}) == len(files) + 1
    stays = [
        "new",
        str(tmp_path),
        "--contour",
        *files[2:4],
        "--target",
        "45, 5 mm",
        "--direction",
        "0, 1",
    ]
    assert main(stays) == 0  # files in the case's own folder stay as they are
    data = tomllib.loads((tmp_path / "case.toml").read_text())
    assert {region["contour"] for region in data["regions"].values()} == {"Node.csv", "node.csv"}


def test_a_region_called_background_is_refused_in_a_case(gel: object) -> None:
    from needlefem.geometry import Contour
    from needlefem.scene import Region

    square = Contour(np.array([[0.02, 0.02], [0.04, 0.02], [0.04, 0.04], [0.02, 0.04]]))
    scene = vary(gel, {"regions": {"background": Region(contour=square, material="gel")}})
    with pytest.raises(CaseError, match="regions.background: this name is reserved for the tissue"):
        build_mesh(scene)


def test_names_with_dots_are_varied_in_quotes(gel: object) -> None:
    scene = vary(gel, {"materials": {**gel.materials, "a.b": gel.materials["gel"]}})
    changed = vary(scene, {'materials."a.b".density': 900.0})
    assert field_of(changed, 'materials."a.b".density') == 900.0
    assert field_of(changed, "materials.gel.density") == 1000.0
