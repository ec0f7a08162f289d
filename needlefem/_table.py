"""Tables that are printed as text or as JSON."""

import dataclasses
from collections.abc import Mapping, Sequence


@dataclasses.dataclass(frozen=True, kw_only=True)
class Table:
    """A table with title, columns and rows.

    Parameters
    ----------
    title : str
    columns : tuple of str
    rows : sequence of sequences
        Cells: texts are printed unchanged, numbers with 4 significant digits.
    passed : bool
        Whether all requirements of the table are satisfied.
    note : str
        Sentence below the table.
    summary : mapping
        Named results, which a case can compare with its expectations.
    charts : mapping
        Charts of the table as SVG, by title.
    """

    title: str
    columns: tuple[str, ...]
    rows: Sequence[Sequence[object]]
    passed: bool = True
    note: str = ""
    summary: Mapping[str, object] = dataclasses.field(default_factory=dict)
    charts: Mapping[str, str] = dataclasses.field(default_factory=dict)

    def text(self) -> str:
        """Return the table as aligned text."""
        cells = [list(self.columns), *([_cell(value) for value in row] for row in self.rows)]
        widths = [max(len(row[i]) for row in cells) for i in range(len(self.columns))]
        lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)) for row in cells]
        lines.insert(1, "  ".join("-" * w for w in widths))
        body = [self.title, *(line.rstrip() for line in lines)]
        return "\n".join([*body, self.note] if self.note else body)

    def record(self) -> dict[str, object]:
        """Return the table as plain data for JSON."""
        rows = [dict(zip(self.columns, row, strict=True)) for row in self.rows]
        return {
            "title": self.title,
            "rows": rows,
            "summary": dict(self.summary),
            "passed": self.passed,
            "note": self.note,
        }


def _cell(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
