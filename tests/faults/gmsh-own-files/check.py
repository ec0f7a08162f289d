"""Regions and faces of Gmsh's own files are their physical groups, in every version."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from needlefem.mesh import cell_measures
from needlefem.mesh import read_plane_mesh

FILES = ["t22", "t40", "t41", "t41b", "t41all", "q41", "mix41", "t41o2"]
AREA = np.pi * 7.5 * 5.0  # of the kidney


def test_every_version_gives_the_same_groups(folder: Path, run) -> None:
    for name in FILES:
        ended = run("new", name, "--mesh", f"{name}.msh", "--unit", "1 mm")
        assert ended.status == 0, ended.err
        text = (folder / name / "case.toml").read_text(encoding="utf-8")
        assert list(tomllib.loads(text)["regions"]) == ["kidney"], name
        assert "a list of: back, sides, skin" in text, name


def test_groups_have_their_measures(folder: Path, run) -> None:
    for name in FILES:
        mesh = read_plane_mesh(folder / f"{name}.msh", 1.0).mesh
        areas = cell_measures(mesh)
        assert areas.sum() == pytest.approx(60.0 * 60.0, rel=1e-9)
        assert len(mesh.subdomains["kidney"]) + len(mesh.subdomains["fat"]) == mesh.nelements
        ends = mesh.p[:, mesh.facets[:, mesh.boundaries["sides"]]]
        assert np.all(np.abs(ends[0]) == pytest.approx(30.0))
        assert np.sum(np.abs(ends[1, 0] - ends[1, 1])) == pytest.approx(120.0)


def test_curved_edges_are_reported(folder: Path, run) -> None:
    ended = run("new", "bent", "--mesh", "t41o2.msh", "--unit", "1 mm")
    assert "Edges are curved by up to 0.111 units of the file" in ended.out
