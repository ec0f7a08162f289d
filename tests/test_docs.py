"""The documentation says what is."""

import re
from pathlib import Path

import pytest

from needlefem.casefile.describe import describe
from needlefem.materials.tissues import describe_tissues
from needlefem.planning.studies import STUDIES
from needlefem.units import UNITS

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def test_the_table_of_keys_is_the_packages_own() -> None:
    assert (ROOT / "docs" / "case-file.md").read_text().endswith(describe())


def test_all_units_are_named() -> None:
    text = (ROOT / "docs" / "case-file.md").read_text()
    assert all(unit in text for units in UNITS.values() for unit in units)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\((?!http)([^)#]+)", page.read_text()):
        assert (page.parent / target).exists(), target


def test_readme_example_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    text = (ROOT / "README.md").read_text()
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL).group(1)
    assert len(code.strip().splitlines()) <= 8
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "README.md", "exec"), {})
    assert (tmp_path / "deformed.png").exists()


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_is_documented(name: str) -> None:
    assert any(f"study {name}" in page.read_text() for page in PAGES)


def test_the_table_of_tissues_is_the_packages_own() -> None:
    assert (ROOT / "docs" / "tissues.md").read_text().endswith(describe_tissues())
