"""A measured table, as the terminal and docs/results show it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

Row = list[Any]


@dataclass(frozen=True)
class Table:
    """A measured table: its texts, (title, format) of each column, and the rows."""

    title: str
    about: str
    columns: tuple[tuple[str, str], ...]
    rows: list[Row]

    def as_json(self, made: dict[str, Any]) -> dict[str, Any]:
        """The table as `page` stores it; made: where it comes from, see `stamp`."""
        columns = [{"title": title, "format": form} for title, form in self.columns]
        rows = [[float(f"{cell:.6g}") if isinstance(cell, float) else cell for cell in row] for row in self.rows]
        return {"title": self.title, "about": self.about, "made": made, "columns": columns, "rows": rows}


def show(name: str, table: Table) -> None:
    """Print a table."""
    print(f"\n--- {name}", flush=True)
    for row in [[title for title, _ in table.columns], *table.rows]:
        cells = [cell if isinstance(cell, str) else "-" if cell is None else f"{cell:.5g}" for cell in row]
        print("  ".join(f"{cell:>12}" for cell in cells), flush=True)
