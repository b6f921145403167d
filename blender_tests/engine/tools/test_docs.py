"""What the pages under docs/ name in the code exists: `path/file.py: Name`, `Class.method` and constants."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PLACES = (ROOT / "karf_engine", ROOT)
REFERENCE = re.compile(r"`([\w/]+\.py): ([^`]+)`")
PAGES = {path.name: path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs").glob("*.md"))}
MENTIONED = [(page, path, name) for page, text in PAGES.items() for path, names in REFERENCE.findall(text)
             for name in re.split(r",\s+", names)]  # fmt: skip


def defined(path: Path) -> set[str]:
    """Functions, classes, constants, and `Class.method` of a file."""
    names = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {part.id for target in targets for part in ast.walk(target) if isinstance(part, ast.Name)}
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{part.name}" for part in node.body if isinstance(part, ast.FunctionDef)}
    return names


@pytest.mark.parametrize(("page", "path", "name"), MENTIONED, ids=lambda value: value)
def test_what_a_page_names_exists(page, path, name):
    files = [place / path for place in PLACES if (place / path).exists()]
    assert files, f"{page} names {path}, which is no file"
    assert name in defined(files[0]), f"{page}: {path} defines no {name}"


@pytest.mark.parametrize("number", range(1, 15))
def test_every_equation_of_the_paper_has_a_place(number):
    rows = [line for line in PAGES["paper.md"].splitlines() if line.startswith("| Eq. ")]
    ranges = [re.match(r"\| Eq\. (\d+)(?: to (\d+))?", row).groups() for row in rows]
    assert any(int(first) <= number <= int(last or first) for first, last in ranges)


def test_settings_that_the_paper_page_names_exist():
    from karf_engine.project.settings import describe

    known = {name for name, _, _ in describe()}
    named = set(re.findall(r"`((?:geometry|segmentation|palette|recoloring)\.[a-z_]+)(?:=[^`]*)?`", PAGES["paper.md"]))
    assert named and named <= known
