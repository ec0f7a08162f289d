"""Random valid scenes: what is drawn, what is required, and a sample that meets it."""

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from needlefem import load_case, simulate
from needlefem.cli.main import main
from needlefem.insertion import TipPhase, energy_terms
from needlefem.scene import Scene, Stage, vary
from needlefem.stress import (
    DrawnQuantity,
    SceneRun,
    Units,
    distance,
    draw_case,
    faults_of,
    in_units,
    scenes,
    turned_mesh,
    turned_scene,
    write_drawn_case,
)
from needlefem.stress.symmetry import ANGLE

SEED = 16
COUNT = 7


def test_a_sample_meets_all_requirements() -> None:
    runs = scenes.run_scenes(SEED, range(COUNT), min(2, os.cpu_count() or 1), print)
    assert len(runs) == COUNT  # too few for the share that must be complete
    assert not any(run.faults for run in runs), "\n".join(scenes.listing(SEED, runs))


def test_draws_follow_from_seed_and_number(tmp_path: Path) -> None:
    first = write_drawn_case(draw_case(3, 5), tmp_path / "a").read_text()
    assert write_drawn_case(draw_case(3, 5), tmp_path / "b").read_text() == first
    assert write_drawn_case(draw_case(3, 6), tmp_path / "c").read_text() != first
    assert write_drawn_case(draw_case(4, 5), tmp_path / "d").read_text() != first


def test_every_kind_is_drawn() -> None:
    kinds = [draw_case(1, number).kinds for number in range(300)]
    drawn = {aspect: {k[aspect] for k in kinds if aspect in k} for aspect in kinds[0] | kinds[1]}
    assert drawn["motion"] == {
        "push", "release", "out and in", "to and fro", "train", "table", "plan",
    }  # fmt: skip
    assert drawn["law"] == {"isotropic", "transversely-isotropic", "orthotropic", "viscoelastic"}
    assert drawn["element"] == {
        "auto", "P1", "P2", "Q1", "Q2", "Q1-Bbar", "MINI", "P2-P1", "Q2-Q1",
    }  # fmt: skip
    assert drawn["integrator"] == {
        "auto", "path_following", "quasi_static", "newmark", "generalized_alpha",
    }  # fmt: skip
    assert drawn["symmetry"] == {"none", "mirror", "rotation", "scaling"}


def test_drawn_scenes_are_read(tmp_path: Path) -> None:
    for number in range(12):
        load_case(write_drawn_case(draw_case(2, number), tmp_path / str(number)))


def test_units_scale_by_their_exponents() -> None:
    units = Units(length=2.0, force=3.0, time=5.0)
    assert units.of(DrawnQuantity(1.0, "pressure")).value == pytest.approx(3.0 / 4.0)
    assert units.of(DrawnQuantity(1.0, "density")).value == pytest.approx(3.0 * 25.0 / 16.0)
    assert units.of(DrawnQuantity(1.0, "speed")).value == pytest.approx(2.0 / 5.0)
    scaled = in_units(draw_case(1, 0), units)
    depth = draw_case(1, 0).data["motion"]["max_depth"].value
    assert scaled.data["motion"]["max_depth"].value == pytest.approx(2.0 * depth)


@pytest.fixture
def stepped(gel: Scene) -> Scene:
    return vary(
        gel,
        {"motion.entry": (0.0287, 0.0), "motion.stages": (Stage(depth=0.02), Stage(depth=0.012))},
    )


def test_faults_are_seen(stepped: Scene) -> None:
    sound = simulate(stepped)
    energies = dataclasses.replace(energy_terms(sound), smallest_dissipation=0.0)
    sound = dataclasses.replace(sound, energies=energies)
    assert list(faults_of(stepped, "run", sound)) == []

    def requirements(**changes: object) -> list[str]:
        changed = dataclasses.replace(sound, **changes)  # type: ignore[arg-type]
        return [fault.requirement for fault in faults_of(stepped, "run", changed)]

    wrong = dataclasses.replace(energies, work=energies.work * (1.0 + 1e-7))
    assert requirements(energies=wrong) == ["energy residual"]
    wrong = dataclasses.replace(energies, smallest_dissipation=-1e-8 * energies.total_absolute_work)
    assert requirements(energies=wrong) == ["energy created"]
    last = dataclasses.replace(sound.states[-1], depth=sound.states[-1].depth + 1e-6)
    assert requirements(states=(*sound.states[:-1], last)) == ["last depth"]
    off = dataclasses.replace(sound.states[3], tip=np.array([0.03, -1e-4]))
    assert requirements(states=(*sound.states[:3], off, *sound.states[4:])) == ["inside the tissue"]
    out = dataclasses.replace(off, tip_phase=TipPhase.OUTSIDE)
    assert requirements(states=(*sound.states[:3], out, *sound.states[4:])) == []
    nan = dataclasses.replace(sound.states[3], tip=np.array([np.nan, 0.0]))
    assert requirements(states=(*sound.states[:3], nan, *sound.states[4:])) == ["finite numbers"]


def test_images_of_a_scene(organ: Scene) -> None:
    model = simulate(vary(organ, {"motion.entry": (0.0287, 0.0)})).model
    for turn in (
        np.array([[np.cos(ANGLE), -np.sin(ANGLE)], [np.sin(ANGLE), np.cos(ANGLE)]]),
        np.diag([-1.0, 1.0]),
    ):
        mesh, image = turned_mesh(model.mesh, turn), turned_scene(organ, turn)
        np.testing.assert_allclose(mesh.p, turn @ model.mesh.p)
        walls = np.sort(model.mesh.p[:, model.mesh.facets[:, model.mesh.boundaries["y_min"]]])
        images = mesh.p[:, mesh.facets[:, mesh.boundaries["y_min"]]]
        np.testing.assert_allclose(np.sort(np.einsum("ij,jkl->ikl", turn.T, images)), walls,
                                   atol=1e-15)  # fmt: skip
        np.testing.assert_allclose(image.motion.direction, turn @ organ.motion.direction)
        np.testing.assert_allclose(
            image.regions["organ"].contour.points, organ.regions["organ"].contour.points @ turn.T
        )


def test_complete_share_and_faults_decide() -> None:
    def run(number: int, status: str) -> SceneRun:
        return SceneRun(number=number, kinds={"symmetry": "none"}, status=status, sentence="")

    many = [run(number, "completed") for number in range(95)]
    assert scenes.passed([*many, *(run(n, "restick") for n in range(5))], 100)
    assert not scenes.passed([*many, *(run(n, "restick") for n in range(6))], 101)
    assert not scenes.passed(many, 96)
    text = "\n".join(scenes.listing(1, [*many, run(95, "restick")]))
    assert text.count("scene") == 2
    assert "needlefem verify --stress scenes --seed 1 --only 95" in text


def test_one_scene_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--stress", "scenes", "--only", "3", "--seed", "2", "--out", str(tmp_path / "x")]
    main(["verify", *arguments])
    assert "1 of 1 scenes run" in capsys.readouterr().out
    assert load_case(tmp_path / "x" / "case.toml").motion.max_depth > 0.0


def test_distance_is_infinite_where_status_differs() -> None:
    from needlefem.stress import SceneAnswer

    one = SceneAnswer(
        status="completed", sentence="", points=np.zeros((1, 2)), path=np.zeros((0, 2)), depth=0.1
    )
    other = dataclasses.replace(one, status="restick")
    assert distance(one, one, np.eye(2))[0] == 0.0
    assert distance(one, other, np.eye(2))[0] == np.inf
    moved = dataclasses.replace(one, points=np.array([[1e-3, 0.0]]))
    assert distance(one, moved, np.eye(2))[0] == pytest.approx(1e-2)
