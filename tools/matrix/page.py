"""The table of docs/versions.md, from docs/versions.json, which the command `matrix` measures.

    python3 -m tools.matrix.page        write the table again

The text around the table is written by hand; the table lies between the marks `<!-- matrix -->` and `<!-- /matrix -->`.
Standard library only.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from .cells import ROOT, all_cells

PAGE = ROOT / "docs" / "versions.md"
RESULTS = ROOT / "docs" / "versions.json"
TITLES = ["cell", "Python", "packages", "tests", "passed", "failed", "skipped", "seconds"]
# packages whose version decides most; docs/versions.json has all
SHOWN = ("bpy", "torch", "numpy", "scipy", "pillow", "opencv-python-headless", "openexr", "pycolmap")


def write(rows: list[dict[str, Any]], made: str, path: Path) -> None:
    """Store results; those of cells that were not run again stay. A skipped cell keeps what it had.

    Args:
        rows: Results as `running.Result` has them.
        made: Date and command.
        path: The file. The page is written anew only from `RESULTS`.
    """
    known = read(path)
    for row in rows:
        if row["status"] != "skipped" or known.get(row["cell"], row)["status"] == "skipped":
            known[row["cell"]] = {"made": made, **row}
    order = [cell.name for cell in all_cells()]
    content = {
        "cells": sorted((row for name, row in known.items() if name in order), key=lambda row: order.index(row["cell"]))
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    if path.resolve() == RESULTS:
        PAGE.write_text(page(), encoding="utf-8")


def read(path: Path) -> dict[str, dict[str, Any]]:
    """The stored results by cell."""
    rows = json.loads(path.read_text(encoding="utf-8"))["cells"] if path.exists() else []
    return {row["cell"]: row for row in rows}


def page() -> str:
    """The page with the table as the results have it."""
    text = PAGE.read_text(encoding="utf-8")
    inside = table(list(read(RESULTS).values()))
    return re.sub(
        r"(<!-- matrix -->\n).*?(<!-- /matrix -->)", lambda marks: marks[1] + inside + marks[2], text, flags=re.DOTALL
    )


def table(rows: list[dict[str, Any]]) -> str:
    """Cells, one a line, and by which commands they were run."""
    lines = [TITLES, ["---"] * len(TITLES), *map(_line, rows)]
    made = sorted({row["made"] for row in rows})
    table = "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)
    return f"{table}\n\n<sub>{'; '.join(made)}.</sub>\n"


def _line(row: dict[str, Any]) -> list[Any]:
    if not row["python"]:
        return [row["cell"], "", f"{row['status']}: {row['reason']}", "", "", "", "", ""]
    packages = ", ".join(f"{name} {row['packages'][name]}" for name in SHOWN if name in row["packages"])
    counts = [row["n_passed"], row["n_failed"], row["n_skipped"], row["seconds"]]
    return [row["cell"], row["python"], packages, f"{row['tests']}; {row['reason']}".strip("; "), *counts]


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
