"""The machinery of the documentation's pages, and where the pages are."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    ROOT / "verification" / "README.md",
    *sorted((ROOT / "cases").rglob("README.md")),
    *sorted(path for path in DOCS.rglob("*.md") if "examples" not in path.parts),
]
WHOLE = [*sorted((DOCS / "tutorial").glob("*.md")), *sorted((DOCS / "how-to").glob("*.md"))]
"""Pages that are run from their first line to their last."""


def site(name: str) -> ModuleType:
    """Return a module of ``docs/site``, which is no package."""
    spec = importlib.util.spec_from_file_location(f"site_{name}", DOCS / "site" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    if str(DOCS / "site") not in sys.path:
        sys.path.append(str(DOCS / "site"))  # its modules import one another
    spec.loader.exec_module(module)
    return module
