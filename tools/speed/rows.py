"""Measured rows as a table of plain text."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

Row = dict[str, Any]


def print_rows(rows: Iterable[Row]) -> None:
    """Rows with the same keys as a table."""
    rows = list(rows)
    table = [list(rows[0]), *[[str(value) for value in row.values()] for row in rows]] if rows else []
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for line in table:
        print("  ".join(f"{cell:>{width}}" for cell, width in zip(line, widths, strict=True)), flush=True)
