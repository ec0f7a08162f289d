"""An expectation of another kind than the value makes a row that says what is there."""

from tests.conftest import CASES

MISFITS = {
    '{key="run.status", value=1}': r"run.status completed 1",
    '{key="run.puncture_depth", value=["1 cm","2 cm"], tolerance="1 cm"}': "run.puncture_depth 0",
    '{key="run.tip_path.0", value="1 cm", tolerance="1 cm"}': "run.tip_path.0 (3, 0) 1",
    '{key="run.energy", value=1}': "run.energy a table 1",
    '{key="run.depth", value=1}': "run.depth a list of",
    '{key="run.energy.nothing", value=1}': "run.energy.nothing none 1",
    '{key="run.depth.9999", value=1}': "run.depth.9999 none 1",
    '{key="run.status", value=[1, 2], tolerance=1}': "run.status completed (1, 2)",
    '{key="run.tip", value=[1, 2], tolerance=1}': "run.tip_phase a list of",
}
COARSE = ["mesh.divisions=[12, 12]", "discretization.path_spacing=6 mm", "needle.tip_radius=6 mm"]


def test_rows_say_what_is_there(folder, run):
    sets = [f"expect=[{','.join(MISFITS)}]", *COARSE]
    options = [part for text in sets for part in ("--set", text)]
    status, out, _ = run("run", CASES / "gel" / "case.toml", *options)
    assert status == 1
    rows = [" ".join(line.split()) for line in out.splitlines()]
    for row in MISFITS.values():
        assert any(line.startswith(row) for line in rows), (row, out)
    assert sum(line.endswith(" no") for line in rows) == len(MISFITS)
