"""A byte-order mark is skipped: it is no part of an axis' name."""


def test_the_mark_is_no_part_of_a_name(folder, run):
    assert run("new", "begun", "--contour", "bom.csv")[0] == 0
    text = (folder / "begun" / "case.toml").read_text(encoding="utf-8")
    assert 'axes = ["y", "z"]' in text
    assert "\ufeff" not in text
