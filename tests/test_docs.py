"""The documentation says what is."""

import re
import runpy
from pathlib import Path

import pytest

from needlefem.cli.experiments import studies
from needlefem.units import UNITS
from tests.pages import DOCS, PAGES, ROOT, WHOLE, site

TABLES = site("tables").PAGES
TOCTREE = re.compile(r"^```{toctree}\n(.*?)^```", re.MULTILINE | re.DOTALL)
TERMS = {
    r"march\w*": "path following",
    r"ledgers?": "energy balance",
    r"snap(?:s|ped|ping)?": "rupture",
    r"lateral hold": "lateral penalty",
    r"sideways": "lateral",
    r"turnover": "total absolute work",
    r"give[sn]? way|lets? go": "rupture, release, deactivate",
    r"(?:is|are) (?:told|worth)": "is reported, has an error of",
    r"what is left": "residual",
    r"abreast|anew|for ever": "level, again, always",
}
"""Words that pages do not use, and the term of the glossary or the plain word that they use."""
QUOTED = re.compile(
    r"^```.*?^```|`[^`]*`|\"[^\"\n]*\"|\*[^*\n]+\*|\]\([^)]*\)", re.MULTILINE | re.DOTALL
)
"""Code, output, names and quotations of a page."""
OUTSIDE = {DOCS / "examples" / "index"}
"""What is made while the site is built."""


@pytest.mark.parametrize("name", TABLES)
def test_tables_are_the_packages_own(name: str) -> None:
    """If this fails, `make tables` writes them anew."""
    assert (DOCS / name).read_text().endswith(TABLES[name][1]())


def children(page: Path) -> list[Path]:
    """Return the pages that a page's tables of contents name, without their endings."""
    found = []
    for block in TOCTREE.findall(page.read_text(encoding="utf-8")):
        entries = [line for line in block.splitlines() if line and not line.startswith(":")]
        for line in entries:
            entry = re.sub(r".*<(.*)>", r"\1", line)
            named = sorted(page.parent.glob(entry + ".md")) or [page.parent / entry]
            found += [path.resolve().with_suffix("") for path in named]
    return found


def test_every_page_is_in_the_table_of_contents() -> None:
    reached, waiting = set(), [DOCS / "index"]
    while waiting:
        page = waiting.pop()
        if page not in reached and page not in OUTSIDE:
            reached.add(page)
            waiting += children(page.with_suffix(".md"))
    assert reached == {path.with_suffix("") for path in PAGES}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_modules_that_a_page_names_are_there(page: Path) -> None:
    if page.stem == "CHANGELOG":
        return
    for name in re.findall(r"`([\w/]+/\w+\.py)`", page.read_text(encoding="utf-8")):
        assert (ROOT / name).exists() or (ROOT / "needlefem" / name).exists(), name


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_pages_use_the_terms_of_the_glossary(page: Path) -> None:
    """Tables that the package prints and the history of changes have words of their own."""
    if page.stem == "CHANGELOG" or page.parent == ROOT / "verification":
        return
    text = page.read_text(encoding="utf-8")
    begins, _ = TABLES.get(str(page.relative_to(DOCS)) if DOCS in page.parents else "", (r"\Z", 0))
    prose = QUOTED.sub("", re.split(begins, text, maxsplit=1, flags=re.MULTILINE)[0])
    for word, term in TERMS.items():
        used = re.search(rf"\b(?:{word})\b", prose, re.IGNORECASE)
        assert used is None, f"'{used and used[0]}' is an old word; the term is: {term}"


def anchors(page: Path) -> set[str]:
    """Return the anchors that a code host and the site give a page's headings."""
    titles = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


@pytest.mark.parametrize(
    "script", sorted((DOCS / "gallery").glob("plot_*.py")), ids=lambda p: p.stem
)
def test_gallery_scripts_draw(
    script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "docs" / "gallery"
    folder.mkdir(parents=True)
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    monkeypatch.chdir(folder)
    runpy.run_path(str(script), run_name="__main__")
    assert list((folder / "out").glob("*.png"))


def test_all_units_are_named() -> None:
    text = (ROOT / "docs" / "case-file.md").read_text()
    assert all(unit in text for units in UNITS.values() for unit in units)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for target, anchor in re.findall(r"\]\((?!http)([^)#]*)#?([^)]*)\)", page.read_text()):
        there = page.parent / target if target else page
        assert there.exists(), target
        assert not anchor or anchor in anchors(there), anchor


def test_every_equation_of_the_theory_has_a_source() -> None:
    text, _, sources = (DOCS / "theory.md").read_text().partition("## Sources")
    equations = [int(n) for n in re.findall(r"^\\tag\{(\d+)\}$", text, re.MULTILINE)]
    assert equations == list(range(1, len(equations) + 1))
    named = re.findall(r"^\| ([\d, ]+) \|", sources, re.MULTILINE)
    assert sorted(int(n) for row in named for n in row.split(",")) == equations


def test_code_is_on_pages_that_are_run() -> None:
    coded = {page for page in PAGES if "```python" in page.read_text(encoding="utf-8")}
    assert coded <= {ROOT / "README.md", *WHOLE}


def test_readme_example_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    text = (ROOT / "README.md").read_text()
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL).group(1)
    assert len(code.strip().splitlines()) <= 8
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "README.md", "exec"), {})
    assert (tmp_path / "deformed.png").exists()


@pytest.mark.parametrize("name", studies())
def test_every_study_is_documented(name: str) -> None:
    assert any(f"study {name}" in page.read_text() for page in PAGES)
