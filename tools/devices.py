"""Write the table of docs/devices.md from the tests that take a card: python -m tools.devices.

Such a test, or its module, has the mark `on_device(part)`. A report of `--device-report`, stored as
docs/results/devices.json, says how they went; without it nothing of the present code has run on a card.
"""

from __future__ import annotations

import ast
import json
from collections import Counter
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PAGE, REPORT = ROOT / "docs" / "devices.md", ROOT / "docs" / "results" / "devices.json"
START, END = "<!-- on_device -->\n", "<!-- end -->"
NEVER = "The present code has never run on a card: there is no report of these tests.\n\n"


def marked() -> list[tuple[str, str, str]]:
    """Return (part, file, test or "") of all marks, sorted."""
    found = []
    for path in sorted((ROOT / "blender_tests").rglob("test_*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            marks = node.decorator_list if isinstance(node, ast.FunctionDef) else [getattr(node, "value", None)]
            for mark in marks:
                if isinstance(mark, ast.Call) and ast.unparse(mark.func) == "pytest.mark.on_device":
                    test = node.name if isinstance(node, ast.FunctionDef) else ""
                    found.append((ast.literal_eval(mark.args[0]), path.relative_to(ROOT).as_posix(), test))
    return sorted(found)


def table(report: dict[str, Any] | None) -> str:
    """Return the table, with how the tests went by a report of a card."""
    lines = [NEVER] if report is None else [f"On {report['hardware']}, with torch {report['torch']}:\n\n"]
    lines.append("| part | tests in `blender_tests/` | on a card |\n|---|---|---|\n")
    for part, file in dict.fromkeys((part, file) for part, file, _ in marked()):
        names = [f"{file}::{test}" for own, path, test in marked() if (own, path) == (part, file)]
        results = {} if report is None else report["tests"]
        ran = Counter(one["outcome"] for test, one in results.items() if any(test.startswith(name) for name in names))
        result = ", ".join(f"{count} {outcome}" for outcome, count in sorted(ran.items())) or "never"
        lines.append(f"| {part} | `{file.removeprefix('blender_tests/')}` | {result} |\n")
    return "".join(lines)


def page() -> str:
    """Return the page with the table of the present tests and report."""
    report = json.loads(REPORT.read_text(encoding="utf-8")) if REPORT.exists() else None
    before, rest = PAGE.read_text(encoding="utf-8").split(START)
    return before + START + table(report) + rest[rest.index(END) :]


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
