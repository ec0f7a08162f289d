import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from needlefem import load_case
from needlefem.cli.common import unused_keys
from needlefem.cli.main import main
from needlefem.io.expectations import KEYS, LIST, TABLE, VALUE
from needlefem.scene import Rayleigh, vary
from needlefem.scene.version_1 import RESULT_KEYS
from tests.conftest import PAPER_CASE, ROOT

LIVER = str(ROOT / "cases" / "liver" / "case.toml")
CASE = str(PAPER_CASE)
SMALL = ["--set", "mesh.divisions=[16, 16]", "--set", "needle.tip_radius=2 mm"]


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    status = main(list(arguments))
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_plan_meets_the_paper(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "plan", CASE)
    assert status == 0
    assert "release at" in out
    assert "plan.unplanned.placed_at" in out
    assert "warning: P1 locks at Poisson's ratio" in err


def test_plan_json_keeps_its_contract(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "plan", CASE, "--json")
    record = json.loads(out)
    assert (status, err) == (0, "")
    contract = {
        "status", "target", "release_point", "placement_error", "unplanned", "depth_only",
        "insertions", "energy_residual", "preflight", "timings", "skipped", "warnings",
    }  # fmt: skip
    assert contract <= set(record)
    for name in ("unplanned", "depth_only"):
        assert {"release_point", "placed_at", "placement_error"} <= set(record[name])
    assert record["target"] == [0.015, 0.03]
    assert all(check["passed"] for check in record["preflight"])


def test_run_json_keeps_its_contract(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "run", CASE, "--json", *SMALL)
    record = json.loads(out)
    contract = {
        "status", "tip_path", "depth", "tip_force", "shaft_force", "seeds", "energy", "timings",
        "skipped", "warnings",
    }  # fmt: skip
    assert status == 0
    assert contract <= set(record)
    assert len(record["depth"]) == len(record["tip_path"]) == len(record["tip_force"])
    assert record["overrides"] == {"mesh.divisions": [16, 16], "needle.tip_radius": "2 mm"}
    assert record["seeds"][0]["status"] == "placed"
    assert record["seeds"][0]["released_at"] == pytest.approx([0.015, 0.05])


def test_run_before_puncture_still_reports_its_error(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "run", CASE, "--json", "--set", "motion.max_depth=1 mm")
    record = json.loads(out)
    assert status == 0
    assert record["status"] == "not_punctured"
    assert record["seeds"][0]["status"] == "not_punctured"
    assert record["seeds"][0]["placement_error"] == pytest.approx(0.03)


def test_results_are_written(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    status, _, _ = run(capsys, "run", CASE, "--out", str(tmp_path / "run"), *SMALL)
    assert status == 0
    names = {p.name for p in (tmp_path / "run").iterdir()}
    tables = {"insertion.csv", "events.csv", "shaft.csv"}
    assert names == {"run.json", "forces.png", "sticking.png", *tables}
    header = (tmp_path / "run" / "insertion.csv").read_text().splitlines()[0]
    assert header == (
        "time [s],depth [m],speed [m/s],tip,y [m],z [m],tip force [N/m],shaft force [N/m],"
        "sticking pieces,slipping forward,slipping backward"
    )
    out = str(tmp_path / "plan")
    assert run(capsys, "plan", CASE, "--out", out, "--no-pictures")[0] == 0
    assert [p.name for p in (tmp_path / "plan").iterdir()] == ["plan.json"]


def test_mistakes_end_with_2_and_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    arguments = ["plan", CASE, "--set", "needle.tip_radiu=1 mm", "--out", str(tmp_path / "out")]
    status, out, err = run(capsys, *arguments)
    assert status == 2
    assert out == ""
    assert err == "needlefem: needle.tip_radiu: unknown key; did you mean 'tip_radius'?\n"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ('target.point=["9 cm", "3 cm"]', "is outside the tissue"),
        ('motion.entry=["1.5 cm", "1 cm"]', "a plan chooses the entry"),
        ("supports.walls.faces=[]", "leave 3 rigid motions of the tissue free"),
        ('regions.prostate.offset=["1 cm", "2 cm"]', "the contour leaves the mesh"),
        ("mesh.divisions=[1, 1]", "no mesh cell is in the contour"),
        ("motion.direction=[1.0, 0.0]", "is fixed by a support"),
        (
            "materials.fat.poissons_ratio=0.5",
            "P1 can't be used for incompressible tissue; use a mixed element",
        ),
        (
            "discretization.element=Q1",
            "Q1 is not defined on triangles; use a mesh of quadrilaterals",
        ),
        ("tissue.plane=strian", "tissue.plane: 'strian' is not known; one of strain, stress"),
    ],
)
def test_scenes_that_can_not_be(
    capsys: pytest.CaptureFixture[str], override: str, says: str
) -> None:
    status, _, err = run(capsys, "plan", CASE, "--set", override)
    assert status == 2
    assert says in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("command", ["run", "plan"])
def test_what_may_be_expected_is_what_there_is(
    capsys: pytest.CaptureFixture[str], command: str
) -> None:
    """A key that a command adds to its JSON belongs into `KEYS` too."""
    _, out, _ = run(capsys, command, CASE, "--json", *SMALL)
    old = {path[0] for path in RESULT_KEYS[command] if len(path) == 1} | {"jumping", "schema"}
    record = {
        k: v
        for k, v in json.loads(out).items()
        if not k.startswith("expect") and k not in old - set(KEYS[command])
    }
    assert set(record) == set(KEYS[command])
    kinds = {list: LIST, dict: TABLE}
    found = {k: kinds.get(type(v), VALUE) for k, v in record.items() if v is not None}
    assert found == {k: KEYS[command][k] for k in found}


def test_missed_expectation_ends_with_1(capsys: pytest.CaptureFixture[str]) -> None:
    wrong = 'expect=[{key="plan.insertions", value=1}, {key="plan.status", value=1}]'
    status, out, _ = run(capsys, "plan", CASE, *SMALL, "--set", wrong)
    assert status == 1
    assert out.count("  no\n") == 2
    assert "plan.status      planned" in out


def test_expectations_of_another_case_are_not_compared(
    capsys: pytest.CaptureFixture[str],
) -> None:
    changed = ("--set", "needle.cutting_force=10 N/m", "--set", "planning.estimate=false")
    status, out, _ = run(capsys, "plan", CASE, *changed)
    assert status == 0
    assert "are not compared, because --set changed needle.cutting_force, planning.estimate" in out
    status, out, _ = run(capsys, "plan", CASE, "--json", *changed)
    record = json.loads(out)
    assert record["expect"] is None
    assert "needle.cutting_force" in record["expect_skipped"]
    status, out, _ = run(capsys, "plan", CASE, "--set", "title=another")
    assert "expected by the case" in out
    assert status == 0


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("plan", CASE, "--set", 'motion.entry=["2 cm", "0 cm"]'), "a plan chooses the entry"),
        (("plan", CASE, "--set", 'motion.stages=[{depth="2 cm"}]'), "run carries stages out"),
        (("plan", CASE, "--set", "targets.count=3"), "only 'study targets'"),
        (("plan", CASE, "--method", "paper", "--search", "grid"), "is golden section"),
        (
            ("plan", CASE, "--method", "paper", "--all-solutions"),
            "is an option of the method of needlefem",
        ),
        (("run", CASE, "--snapshots", "3"), "--snapshots: would be ignored: .*--out DIR"),
        (("run", CASE, "--set", 'planning.tolerance="1 mm"'), "'run' does not plan"),
        (("run", CASE, "--set", 'damping.mass_rate="1 1/s"'), "the integrator is 'path_following'"),
        (
            ("run", CASE, "--set", "discretization.rho_inf=0.5"),
            "the integrator is 'path_following'",
        ),
        (
            ("run", CASE, "--set", 'discretization.time_step="1 ms"'),
            "the integrator is 'path_following'",
        ),
        (
            ("run", CASE, "--set", 'needle.slip_weakening_distance="1 mm"'),
            "static friction is kinetic",
        ),
        (("run", CASE, "--set", 'mesh.refine.corridor_width="1 mm"'), "corridor_size is 0"),
        (("plan", CASE, "--set", "planning.max_unknowns=9"), "planning.accuracy is 0"),
        (("modes", CASE, "--set", 'needle.tip_radius="3 mm"'), "without a needle"),
        (("run", CASE, "--set", 'outputs.pictures=["depth"]'), "a plan alone has pictures"),
        (("run", CASE, "--set", "outputs.folder=there"), "are written to --out DIR"),
        (("plan", CASE, "--set", "outputs.folder=there"), "are written to --out DIR"),
        (("modes", CASE, "--set", "outputs.folder=there"), "are written to --out DIR"),
        (("plan", CASE, "--set", "planning.directions=[[0.1, 1.0]]"), "no obstacle makes a plan"),
        (
            ("study", "energy", CASE, "--against", CASE),
            "--against: would be ignored: study 'energy'",
        ),
        (("verify", "patch_test", "--element", "P1"), "patch_test: would be ignored"),
        (("verify", "--element", "P1", "--quick"), "--quick: would be ignored"),
        (("verify", "--plane", "stress", "patch_test"), "--plane: would be ignored"),
        (("verify", "--set", "alpha=1", "patch_test"), "--set alpha=1: would be ignored"),
        (("verify", "--integrator", "hht", "--element", "P1"), "--element: would be ignored"),
    ],
)
def test_what_would_be_ignored_is_refused(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], says: str
) -> None:
    status, out, err = run(capsys, *arguments)
    assert status == 2
    assert re.search(says, err), err
    assert not out
    assert len(err.splitlines()) == 1


def test_keys_of_a_file_without_effect_are_told() -> None:
    scene = load_case(CASE)
    assert not unused_keys(scene, "plan")
    changes = {
        "mesh.refine.corridor_width": 1e-2, "mesh.refine.corridor_depth": 3e-2,
        "needle.slip_weakening_distance": 1e-3, "planning.max_unknowns": 9,
        "outputs.folder": "there",
        "planning.directions": ((0.1, 1.0),), "damping": Rayleigh(mass_rate=1.0),
    }  # fmt: skip
    told = unused_keys(vary(scene, changes), "plan")
    assert {sentence.split()[0] for sentence in told} == set(changes)
    assert all("has no effect: " in sentence for sentence in told)
    used = {"mesh.refine.corridor_width": 1e-2, "mesh.refine.corridor_size": 5e-3}
    assert not unused_keys(vary(scene, used), "plan")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((), "COMMAND"),
        (("plot",), "invalid choice: 'plot'"),
        (("plan",), "required: case"),
        (("plan", CASE, "--serach", "grid"), "unrecognized arguments: --serach"),
        (("plan", CASE, "--search", "x" * 5000), "invalid choice"),
        (("run", CASE, "--snapshots", "three\nfour"), "invalid int value"),
        (("bench", "plan", CASE, "--against"), "expected one argument"),
    ],
)
def test_usage_errors_are_two_lines(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], says: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    lines = capsys.readouterr().err.splitlines()
    assert ended.value.code == 2
    assert len(lines) == 2
    assert says in lines[0]
    assert len(lines[0]) < 500
    assert lines[1].endswith("--help' lists what can be given")


def test_plan_without_solution_ends_with_3(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "plan", CASE, "--json", "--set", "motion.max_depth=1 cm")
    assert status == 3
    assert json.loads(out)["status"] == "beyond_max_depth"


COARSE = (
    "--set", "mesh.interfaces=by_centroid", "--set", "mesh.refine.contour_size=6 mm",
    "--set", "discretization.path_spacing=5 mm",
)  # fmt: skip


def test_a_plan_that_obstacles_block_ends_with_3_and_says_which(
    capsys: pytest.CaptureFixture[str],
) -> None:
    straight = ("--set", "planning.directions=[]", *COARSE)
    status, out, _ = run(capsys, "plan", LIVER, "--json", *straight)
    record = json.loads(out)
    assert (status, record["status"], record["release_point"]) == (3, "unreachable", None)
    assert (record["barred"]["obstacle"], record["barred"]["distance"]) == ("rib-6", 0.0)
    assert record["obstacles"] == record["refused"] == []


def test_a_run_through_an_obstacle_is_warned_of(capsys: pytest.CaptureFixture[str]) -> None:
    short = ("--set", "motion.max_depth=3 cm", *COARSE)
    status, _, err = run(capsys, "run", LIVER, *short)
    assert status == 0
    assert "warning: the needle goes through 'rib-6' (clearance 0.3 cm)" in err


def test_too_coarse_a_mesh_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = run(capsys, "plan", CASE, "--set", "mesh.divisions=[6, 6]")
    assert status == 1
    assert "refused: check 'needle resolution'" in err


def test_no_renderer_ends_with_4(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from needlefem.plotting import images as backend

    monkeypatch.setattr(backend, "WINDOWS", ())
    backend.renderer.cache_clear()
    status, _, err = run(capsys, "plan", CASE, "--out", str(tmp_path))
    backend.renderer.cache_clear()
    assert status == 4
    assert "apt-get install" in err
    assert [p.name for p in tmp_path.iterdir()] == ["plan.json"]


def test_verify_one_problem(capsys: pytest.CaptureFixture[str]) -> None:
    folder = str(ROOT / "verification")
    status, out, _ = run(capsys, "verify", "patch_test", "--problems", folder)
    assert status == 0
    assert "P2, nu 0.4999: largest error" in out
    status, out, _ = run(capsys, "verify", "patch_test", "--problems", folder, "--json")
    record = json.loads(out)
    assert record["passed"]
    assert all(item["reference_met"] for item in record["problems"][0]["answers"])


def test_verify_unknown_problem(capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = run(capsys, "verify", "patch_tst", "--problems", str(ROOT / "verification"))
    assert status == 2
    assert "did you mean 'patch_test'?" in err


OWN = """
from needlefem.checks.reference_problem import Problem, ProblemResult, Quantity

def run(quick):
    one = Quantity(label="one", value=VALUE, reference=1.0, tolerance=1e-3)
    return ProblemResult(quantities=[one])

PROBLEM = Problem(
    name="own", requirement="One.", reference="exact", tolerance_rationale="small", run=run
)
"""


def test_verify_takes_a_folder_of_ones_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def verify(*more: str) -> int:
        return run(capsys, "verify", "--problems", str(tmp_path), *more)[0]

    (tmp_path / "own.py").write_text(OWN.replace("VALUE", "1.0001"))
    assert verify() == 1  # nothing is recorded yet
    assert (verify("--record"), verify()) == (0, 0)
    (tmp_path / "own.py").write_text(OWN.replace("VALUE", "1.0002"))
    assert verify() == 1  # within its tolerance, but not what it was
    assert (verify("--record"), verify()) == (0, 0)
    (tmp_path / "own.py").write_text(OWN.replace("VALUE", "1.1"))
    assert (verify("--record"), verify()) == (1, 1)  # a record makes nothing right
    (tmp_path / "own.py").write_text("one = 1\n")
    status, _, err = run(capsys, "verify", "--problems", str(tmp_path))
    assert status == 2
    assert "own.py' has no PROBLEM; write PROBLEM = Problem(...)" in err


def test_studies_are_listed_and_run(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "study", "list")
    assert status == 0
    assert "convergence" in out
    status, out, _ = run(capsys, "study", "robust", CASE, "--json")
    assert status == 0
    assert json.loads(out)["tables"][0]["rows"][0]["carried out"] == "the case itself"


def test_debug_shows_a_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    _, _, err = run(capsys, "plan", "nowhere.toml", "--debug")
    assert "Traceback" in err


def test_modes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["modes", str(PAPER_CASE), "--count", "3", "--json", "--out", str(tmp_path)]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["frequencies"] == sorted(record["frequencies"])
    assert record["critical_steps"]["row-sum"] > record["critical_steps"]["consistent"]
    assert {p.name for p in tmp_path.iterdir()} == {"modes.json", "modes.vtu", "modes.png"}
    assert main(["modes", str(PAPER_CASE), "--count", "0"]) == 2
    assert "--count: 0 modes; give 1 to 599" in capsys.readouterr().err


def test_integrators_are_qualified_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", "--integrator", "hht", "--set", "alpha=-0.2", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)[0]
    assert record["passed"]
    assert record["measured"]["spectral radius at w dt = 1000"] == pytest.approx(2 / 3, abs=1e-4)
    assert main(["verify", "--integrator", "all"]) == 0
    assert "stability limit of w dt" in capsys.readouterr().out
    assert main(["verify", "--integrator", "quasi_static"]) == 2
    assert "quasi-static steps move no mass" in capsys.readouterr().err
    assert main(["verify", "--integrator", "hht", "--set", "alpa=-0.2"]) == 2
    assert "did you mean 'alpha'" in capsys.readouterr().err


def test_the_papers_method_is_beside_ours(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    quick = ["--set", "mesh.divisions=[13, 13]", "--set", "motion.speed=1.5 cm/s",
             "--set", "target.point=[\"1.5 cm\", \"1.2 cm\"]"]  # fmt: skip
    arguments = ["plan", CASE, "--method", "paper", *quick]
    status, out, err = run(capsys, *arguments, "--json", "--out", str(tmp_path))
    record = json.loads(out)
    assert (status, err) == (0, "")
    assert record["method"] == "paper"
    assert record["search"]["method"] == "golden"
    assert record["ours"]["search"]["method"] == "root"
    assert record["steps"] > 0
    assert min(record["seconds"], record["ours"]["seconds"]) > 0.0
    assert [row["refined"] for row in record["drift"]] == [1, 2]
    assert json.loads((tmp_path / "plan.json").read_text()) == record
    assert main([*arguments, "--search", "root"]) == 2
    assert "the method of the paper is golden section" in capsys.readouterr().err


@pytest.mark.parametrize(("arguments", "status"), [(["info"], 0), (["plan", "nothing"], 2)])
def test_process_says_all_and_ends_with_the_status(arguments: list[str], status: int) -> None:
    command = [sys.executable, "-m", "needlefem", *arguments]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == status
    said = ended.stdout if status == 0 else ended.stderr
    assert said.startswith("needlefem")
    assert said.endswith("\n")


def test_process_ends_quietly_when_nobody_reads() -> None:
    command = [sys.executable, "-m", "needlefem", "plan", CASE, *SMALL, "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as ended:
        assert ended.stdout is not None
        assert ended.stderr is not None
        ended.stdout.close()
        said = ended.stderr.read().decode()
    assert "Traceback" not in said
