"""The tables of docs/versions.md, from docs/versions.json, which the command `matrix` measures.

    python3 -m tools.matrix.page        write the tables again

The text around the tables is written by hand; a table lies between the marks `<!-- NAME -->` and `<!-- /NAME -->`.
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
SHOWN = ("bpy", "torch", "numpy", "scipy", "pillow", "opencv-python-headless", "openexr", "pycolmap", "numba")


def write_cells(rows: list[dict[str, Any]], made: str, path: Path) -> None:
    """Store results; those of cells that were not run again stay. A skipped cell keeps what it had.

    Args:
        rows: Results as `running.Result` has them.
        made: Date and command.
        path: The file. The page is written anew only from `RESULTS`.
    """
    known = {row["cell"]: row for row in read(path)["cells"]}
    for row in rows:
        if row["status"] != "skipped" or known.get(row["cell"], row)["status"] == "skipped":
            known[row["cell"]] = {"made": made, **row}
    _write({"cells": [known[cell.name] for cell in all_cells() if cell.name in known]}, path)


def write_wheels(answers: dict[str, dict[str, str]], made: str, path: Path) -> None:
    """Store for which platforms and Pythons there are wheels; arguments as `wheels.ask` and `write_cells` have them."""
    _write({"wheels": {"made": made, "answers": answers}}, path)


def _write(part: dict[str, Any], path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(read(path) | part, indent=1) + "\n", encoding="utf-8")
    if path.resolve() == RESULTS:
        PAGE.write_text(page(), encoding="utf-8")


def read(path: Path) -> dict[str, Any]:
    """The stored results: `cells` and `wheels`."""
    stored = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return {"cells": [], "wheels": {"made": "", "answers": {}}} | stored


def page() -> str:
    """The page with its tables as the results have them."""
    text, results = PAGE.read_text(encoding="utf-8"), read(RESULTS)
    for name, inside in (("matrix", cells_table(results["cells"])), ("wheels", wheels_table(results["wheels"]))):
        marks = rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)"
        text = re.sub(marks, lambda found, inside=inside: found[1] + inside + found[2], text, flags=re.DOTALL)
    return text


def cells_table(rows: list[dict[str, Any]]) -> str:
    """Cells, one a line, and by which commands they were run."""
    return _table([TITLES, *map(_line, rows)], sorted({row["made"] for row in rows}))


def wheels_table(wheels: dict[str, Any]) -> str:
    """Platforms, one a line, and a column for each Python."""
    answers = wheels["answers"]
    pythons = sorted({python for row in answers.values() for python in row}, key=lambda name: int(name[2:]))
    lines = [[platform, *(row[python] for python in pythons)] for platform, row in answers.items()]
    return _table([["system", *(f"Python {python}" for python in pythons)], *lines], [wheels["made"]])


def _table(lines: list[list[Any]], made: list[str]) -> str:
    lines = [lines[0], ["---"] * len(lines[0]), *lines[1:]]
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
