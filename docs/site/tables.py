"""Write the tables that the package prints into the pages that end with them: `make tables`."""

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

from commands_table import describe_commands
from keys_table import describe
from reference import FOLDERS, folder_page, folders_table

from needlefem.materials.catalogue import describe_tissues

DOCS = Path(__file__).parents[1]
PAGES: dict[str, tuple[str, Callable[[], str]]] = {
    "case-file.md": (r"^## `\[", describe),
    "tissues.md": (r"^\| tissue ", describe_tissues),
    "reference/commands.md": (r"^## `needlefem |\Z", describe_commands),
    "reference/python.md": (r"^## Folders|\Z", folders_table),
    **{
        f"reference/python/{folder}.md": (r"\A", partial(folder_page, folder)) for folder in FOLDERS
    },
}
"""Where each page's table begins, and what prints it."""


def main() -> None:
    """Replace everything from a table's beginning on."""
    for name, (begins, table) in PAGES.items():
        page = DOCS / name
        page.touch()
        text = page.read_text(encoding="utf-8")
        found = re.search(begins, text, re.MULTILINE)
        if found is None:
            raise SystemExit(f"{page} has no table")
        page.write_text(text[: found.start()] + table(), encoding="utf-8")


if __name__ == "__main__":
    main()
