"""Write docs/captures_and_splats.md from the tests that open files of other programs: python -m tools.opens [--check].

Such a test, or a row of its table, has the mark `opens(kind, program, files, notes)` with the texts of a row of the page.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "captures_and_splats.md"
START, END = "<!-- opens: {} -->\n", "<!-- end -->"
HEAD = "| from | files | notes |\n|---|---|---|\n"


def rows() -> list[tuple[str, str, str, str]]:
    """Return (kind, program, files, notes) of all marks, sorted by program."""
    paths = sorted((ROOT / "blender_tests").rglob("test_*.py"))
    found = {row for path in paths for row in _marks(ast.parse(path.read_text(encoding="utf-8")))}
    return sorted(found, key=lambda row: (row[1].lower(), *row))


def _marks(tree: ast.AST) -> Iterator[tuple[str, str, str, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "pytest.mark.opens":
            kind, program, files, notes = (ast.literal_eval(argument) for argument in node.args)
            yield kind, program, files, notes


def page() -> str:
    """Return the page with its tables as the tests have them."""
    text = PAGE.read_text(encoding="utf-8")
    for kind in sorted({row[0] for row in rows()}):
        start = text.index(START.format(kind)) + len(START.format(kind))
        lines = [f"| {program} | {files} | {notes} |\n" for own, program, files, notes in rows() if own == kind]
        text = text[:start] + HEAD + "".join(lines) + text[text.index(END, start) :]
    return text


def main() -> int:
    """Write the page; with --check only say by the exit code whether it is up to date."""
    if "--check" in sys.argv[1:]:
        return int(PAGE.read_text(encoding="utf-8") != page())
    PAGE.write_text(page(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
