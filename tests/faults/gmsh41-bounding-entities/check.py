"""Regions are the file's physical groups alone."""

import tomllib
from pathlib import Path


def test_regions_are_the_physical_groups(folder: Path, run) -> None:
    ended = run("new", "mine", "--mesh", "full41.msh", "--unit", "1 mm")
    assert ended.status == 0, ended.err
    case = tomllib.loads((folder / "mine" / "case.toml").read_text(encoding="utf-8"))
    assert list(case["regions"]) == ["organ"]
    assert sorted(case["materials"]) == ["fat", "organ"]
    assert "a list of: floor, sides, skin" in (folder / "mine" / "case.toml").read_text()


def test_without_groups_all_is_background(folder: Path, run) -> None:
    text = (folder / "full41.msh").read_text()
    head, _, rest = text.partition("$PhysicalNames")
    text = head + rest.partition("$EndPhysicalNames\n")[2]
    lines = text.splitlines()
    first = lines.index("$Entities") + 2
    counts = [int(x) for x in lines[first - 1].split()]
    for number in range(first + counts[0], first + sum(counts)):
        parts = lines[number].split()
        lines[number] = " ".join([*parts[:7], "0", *parts[8 + int(parts[7]) :]])
    (folder / "none.msh").write_text("\n".join(lines) + "\n")
    ended = run("new", "plain", "--mesh", "none.msh", "--unit", "1 mm")
    assert ended.status == 0, ended.err
    case = tomllib.loads((folder / "plain" / "case.toml").read_text(encoding="utf-8"))
    assert "regions" not in case
    assert case["tissue"]["default_material"] == "background"
