"""The tables of docs/reliability.md, from docs/reliability/*.json, which the commands `faults` and `fuzz` measure.

    python3 -m tools.reliability.page        write the tables again

The text around the tables is written by hand; a table lies between the marks `<!-- NAME -->` and `<!-- /NAME -->`.
Standard library only.
"""

from __future__ import annotations

import json
import platform
import re
import time
from datetime import date
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = DOCS / "reliability.md"
FOLDER = DOCS / "reliability"
NAMES = ("faults", "fuzz")
MOST_SEEN = 1  # sentences of a row


def made(start: float, arguments: list[str], verb: str) -> dict[str, Any]:
    """When, how and on what a report was made. start: time.monotonic() when it began."""
    command = " ".join(["python3 tools/dev.py", verb, *arguments])
    return {"date": date.today().isoformat(), "command": command, "seconds": round(time.monotonic() - start),
            "system": f"{platform.system()}, Python {platform.python_version()}"}  # fmt: skip


def write(name: str, report: dict[str, Any]) -> None:
    """Store a report, and write its table into the page. `made`: of each run that its rows are from."""
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{name}.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(page(), encoding="utf-8")


def read(name: str) -> dict[str, Any]:
    """The stored report; an empty one where there is none."""
    path = FOLDER / f"{name}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {"made": [], "rows": []}


def page() -> str:
    """The page with its tables as the reports have them; a table without a report is left alone."""
    text = PAGE.read_text(encoding="utf-8")
    for name in NAMES:
        report = read(name)
        if report["rows"]:
            table = TABLES[name](report)
            marks = rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)"
            text = re.sub(marks, lambda found, table=table: found[1] + table + found[2], text, flags=re.DOTALL)
    return text


def faults_table(report: dict[str, Any]) -> str:
    """Fault, tries, lost data, other flaws, and what the user sees."""
    rows = [
        [row["fault"], row["tries"], row["lost"], row["flaws"], " / ".join(row["seen"][:MOST_SEEN]) or "nothing"]
        for row in report["rows"]
    ]
    return _table(["fault", "tries", "lost data", "other flaws", "what the user sees, most often"], rows, report)


def fuzz_table(report: dict[str, Any]) -> str:
    """Reader, executions, how many files were read and refused, and the flaws found."""
    rows = [
        [row["reader"], row["executions"], row["accepted"], row["refused"], sum(row["findings"].values())]
        for row in report["rows"]
    ]
    total = ["all", *(sum(row[column] for row in rows) for column in range(1, 5))]
    return _table(["reader", "executions", "read", "refused in a sentence", "flaws"], [*rows, total], report)


TABLES = {"faults": faults_table, "fuzz": fuzz_table}


def _table(titles: list[str], rows: list[list[Any]], report: dict[str, Any]) -> str:
    cells = [titles, ["---"] * len(titles), *rows]
    lines = ["| " + " | ".join(str(cell).replace("|", "/") for cell in row) + " |" for row in cells]
    origins = [f"{made['date']}, `{made['command']}`, {made['system']}, {made['seconds']} s" for made in report["made"]]
    return "\n".join([*lines, "", f"<sub>{'; '.join(origins)}.</sub>", ""])


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
