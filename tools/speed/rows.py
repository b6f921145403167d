"""Cases measured side by side, and measured rows as a table of plain text."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

Row = dict[str, Any]


def median_seconds(cases: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Median wall seconds of each case; they take turns, and the first round warms up."""
    seconds: dict[str, list[float]] = {name: [] for name in cases}
    for repeat in range(repeats + 1):
        for name, work in cases.items():
            start = time.perf_counter()
            work()
            if repeat:
                seconds[name].append(time.perf_counter() - start)
    return {name: statistics.median(values) for name, values in seconds.items()}


def print_rows(rows: Iterable[Row]) -> None:
    """Rows with the same keys as a table."""
    rows = list(rows)
    table = [list(rows[0]), *[[str(value) for value in row.values()] for row in rows]] if rows else []
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for line in table:
        print("  ".join(f"{cell:>{width}}" for cell, width in zip(line, widths, strict=True)), flush=True)
