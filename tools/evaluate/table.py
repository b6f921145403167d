"""A measured table: in memory, and as docs/results/<name>.json."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

from .sources import ROOT

FOLDER = ROOT / "docs" / "results"
Cell = float | int | str | None
Figures = Mapping[str, Cell]  # by the names of `tools.metrics.METRICS`, or a title of their own


@dataclass(frozen=True)
class Table:
    """Rows of figures.

    Attributes:
        label: the title of the first column.
        rows: figures of each row by its label; a column that a row lacks is empty.
    """

    label: str
    rows: Mapping[str, Figures]

    @property
    def columns(self) -> list[str]:
        """Names of all columns, in the order of their first use."""
        return list(dict.fromkeys(name for figures in self.rows.values() for name in figures))

    def content(self) -> dict[str, Any]:
        """Return the table as JSON values, six digits each."""
        rows = [[label, *(_rounded(row.get(name)) for name in self.columns)] for label, row in self.rows.items()]
        return {"label": self.label, "columns": self.columns, "rows": rows}


def _rounded(cell: Cell) -> Cell:
    return float(f"{cell:.6g}") if isinstance(cell, float) else cell


def write(name: str, table: Table, sources: Mapping[str, str], seconds: float) -> None:
    """Store a table with its origin: date, commit, processor seconds and the digests of its sources."""
    made = {"date": date.today().isoformat(), "commit": _commit(), "seconds": round(seconds), "sources": dict(sources)}
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{name}.json").write_text(
        json.dumps(table.content() | {"made": made}, indent=1) + "\n", encoding="utf-8"
    )


def read(name: str, folder: Path = FOLDER) -> dict[str, Any]:
    """Return the content of docs/results/<name>.json; empty where the table was never measured."""
    file = folder / f"{name}.json"
    return json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}


def _commit() -> str:
    """The checkout's commit, marked if the measured code is not committed."""
    run = {"cwd": ROOT, "capture_output": True, "text": True, "check": True}
    commit = subprocess.run(["git", "rev-parse", "--short=10", "HEAD"], **run).stdout.strip()
    changes = subprocess.run(["git", "status", "--porcelain", "karf_engine", "tools"], **run).stdout.strip()
    return f"{commit} with changes" if changes else commit
