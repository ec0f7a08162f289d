"""A folder holds one result: nothing of an earlier one, nothing of the user's is removed."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import needlefem
from needlefem.io.result_folder import result_folder

OTHER = ["--set", 'needle.cutting_force="100 N/m"', "--no-pictures", "--out", "o"]


def names(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.*"))


def test_files_of_an_earlier_result_are_removed(folder, run):
    shutil.rmtree("o", ignore_errors=True)
    assert run("run", "case.toml", "--snapshots", "3", "--out", "o")[0] == 0
    own = [Path("o/notes.txt"), Path("o/insertion/mine.vtu"), Path("o/forces.pdf"), Path("o/x.csv")]
    for path in own:
        path.write_text("the user's")
    assert Path("o/forces.png").exists()
    assert Path("o/insertion/0002.vtu").exists()
    assert run("run", "case.toml", *OTHER)[0] == 0
    assert names(Path("o")) == sorted(
        ["run.json", "insertion.csv", "events.csv", "shaft.csv", "notes.txt",
         "insertion/mine.vtu", "forces.pdf", "x.csv"]
    )  # fmt: skip
    needlefem.load_result("o")


def test_a_refused_command_leaves_the_earlier_result(folder, run):
    shutil.rmtree("o", ignore_errors=True)
    assert run("run", "case.toml", "--no-pictures", "--out", "o")[0] == 0
    before = {name: (Path("o") / name).read_bytes() for name in names(Path("o"))}
    assert run("run", "case.toml", "--set", "motion.entry=[1]", "--out", "o")[0] == 2
    assert {name: (Path("o") / name).read_bytes() for name in names(Path("o"))} == before


def test_a_result_of_another_command_is_not_mixed(folder, run):
    shutil.rmtree("o", ignore_errors=True)
    assert run("run", "case.toml", "--no-pictures", "--out", "o")[0] == 0
    status, _, err = run("plan", "case.toml", "--no-pictures", "--out", "o")
    assert status == 2
    assert "'o' holds the result of 'run'" in err


def test_a_file_of_the_users_with_one_of_our_names_stays(folder, run):
    shutil.rmtree("o", ignore_errors=True)
    Path("o").mkdir()
    Path("o/insertion.csv").write_text("mine")
    status, _, err = run("run", "case.toml", "--no-pictures", "--out", "o")
    assert status == 2
    assert "'insertion.csv', which is not a result of this command" in err
    assert Path("o/insertion.csv").read_text() == "mine"


def test_of_two_simultaneous_runs_one_is_refused(folder, run):
    shutil.rmtree("o", ignore_errors=True)
    code = (
        "import sys; from needlefem.io.result_folder import result_folder\n"
        "with result_folder('o', 'run') as folder:\n"
        "    folder.begin(); print('in', flush=True); sys.stdin.read()\n"
    )
    holder = subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert holder.stdout.readline() == b"in\n"
    status, _, err = run("run", "case.toml", "--no-pictures", "--out", "o")
    assert status == 2
    assert f"process {holder.pid} is writing into 'o'" in err
    holder.kill()  # the lock goes with its process, its file stays
    holder.communicate()
    assert Path("o/.needlefem.lock").exists()
    assert run("run", "case.toml", "--no-pictures", "--out", "o")[0] == 0
    assert not Path("o/.needlefem.lock").exists()


def test_left_overs_of_killed_processes_are_removed(folder, run):
    shutil.rmtree("o", ignore_errors=True)
    left = [Path("o/.part-a1b2c3d4.png"), Path("o/insertion/.part-host-123-4.vtu")]
    stay = Path("o/.part-of-mine.txt")
    Path("o/insertion").mkdir(parents=True)
    for path in [*left, stay]:
        path.write_text("half")
    with result_folder("o", "run"):
        assert [path.exists() for path in left] == [False, False]
        assert stay.exists()
    dead = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"],
                          capture_output=True, text=True, check=True).stdout.strip()  # fmt: skip
    host = "".join(c for c in os.uname().nodename if c.isascii() and c.isalnum())[:40]
    gone, alive = Path(f".part-{host}-{dead}-0.png"), Path(f".part-{host}-{os.getppid()}-0.png")
    gone.write_text("half")
    alive.write_text("half")
    assert run("render", "case.toml", "--setup", "--out", "x.png")[0] == 0
    assert (gone.exists(), alive.exists()) == (False, True)
