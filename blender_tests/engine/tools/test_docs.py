"""What README.md and the pages under docs/ name exists: files, folders, links, pictures, names in the code, messages."""

import ast
import re
from pathlib import Path

import pytest

from blender_tests.engine.test_layering import FLOORS

ROOT = Path(__file__).resolve().parents[3]
DOCS = ROOT / "docs"
PLACES = (ROOT / "karf_engine", ROOT)
REFERENCE = re.compile(r"`([\w/]+\.py): ([^`]+)`")
PAGES = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for path in [
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        *sorted(DOCS.glob("*.md")),
        *sorted(DOCS.glob("tasks/*.md")),
    ]
}
MENTIONED = [(page, path, name) for page, text in PAGES.items() for path, names in REFERENCE.findall(text)
             for name in re.split(r",\s+", names)]  # fmt: skip


FENCE = re.compile(r"^ *```.*?^ *```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
CODE = re.compile(r"`([^`\n]+)`")
# what a page writes of a file: a Python file, or a path below a folder of the repository
SOURCE = re.compile(r"^((?:\w+/)*\w+\.py)(?=$|[:.])")
TOP = r"karf_engine|karf_blender|tools|docs|blender_tests|notebooks|requirements|demo"
BELOW = re.compile(rf"^((?:{TOP})/[\w./-]*)(?=$|:)")
ROOM = re.compile(r"^((?:\w+/)+)$")
ABOUT_THE_CODE = {f"docs/{name}.md" for name in ("architecture", "conventions", "extending", "glossary", "paper")}
PYTHON = [path for top in ("karf_engine", "karf_blender", "tools") for path in (ROOT / top).rglob("*.py")]
SOURCES = {path.name for path in PYTHON} | {f"{path.parent.name}/" for path in PYTHON}
CODE_PLACES = (ROOT, ROOT / "karf_engine", ROOT / "karf_blender", ROOT / "tools")
TEST_PLACES = (ROOT / "blender_tests", ROOT / "blender_tests" / "engine")


GENERATED = {"docs/library.md", "docs/command_line.md"}


def paths_of(page: str) -> set[str]:
    """Files and folders of the repository that a page names; room folders where the page is about the code."""
    paths = set()
    for code in CODE.findall(FENCE.sub("", PAGES[page])):
        patterns = (SOURCE, BELOW, ROOM) if page in ABOUT_THE_CODE else (SOURCE, BELOW)
        paths |= {found[1] for found in (pattern.match(code) for pattern in patterns) if found}
    return paths


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
    assert files, f"{page} names {path}, which is not a file"
    assert name in defined(files[0]), f"{page}: {path} defines no {name}"


def is_there(path: str) -> bool:
    """From the root, from a package's folder, or among the tests; a bare name is that of any file or folder of the packages."""
    places = TEST_PLACES if path.rpartition("/")[2].startswith("test_") else CODE_PLACES
    return any((place / path).exists() for place in (*places, ROOT)) or path in SOURCES


@pytest.mark.parametrize("page", PAGES)
def test_files_that_a_page_names_exist(page):
    assert [path for path in sorted(paths_of(page)) if not is_there(path)] == []


def members() -> dict[str, set[str]]:
    """What each class of the packages has, by its name: methods, attributes, and what its methods set."""
    found = {}
    for node in (node for path in PYTHON for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))):
        if isinstance(node, ast.ClassDef):
            parts = list(ast.walk(node))
            names = {part.name for part in parts if isinstance(part, ast.FunctionDef)}
            names |= {part.id for part in parts if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)}
            names |= {part.attr for part in parts if isinstance(part, ast.Attribute)}
            found.setdefault(node.name, set()).update(names)
    return found


def test_members_of_classes_that_a_page_names_exist():
    """`Class.member`, where the class is one of the packages'; docs/blender.md speaks of Blender's own."""
    left_out = {*GENERATED, "docs/blender.md"}
    known, pages = members(), [(page, text) for page, text in PAGES.items() if page not in left_out]
    named = [(page, *name) for page, text in pages for name in re.findall(r"`([A-Z]\w+)\.(\w+)\b", text)]
    assert [name for name in named if name[1] in known and name[2] not in known[name[1]]] == []


@pytest.mark.parametrize("page", PAGES)
def test_links_and_pictures_of_a_page_are_there(page):
    links = [link.partition("#")[0] for link in LINK.findall(CODE.sub("", FENCE.sub("", PAGES[page])))]
    missing = [link for link in links if link and "://" not in link and not ((ROOT / page).parent / link).exists()]
    assert not missing


def test_every_picture_is_shown_by_a_page():
    shown = {((ROOT / page).parent / link).resolve() for page, text in PAGES.items() for link in LINK.findall(text)}
    assert set((DOCS / "images").iterdir()) <= shown


def test_the_drawing_of_the_engine_shows_its_floors_from_the_top():
    """The packages' faces are not rooms of the drawing."""
    drawn = re.findall(r'font-weight="bold">(\w+)</text>', (DOCS / "images" / "architecture.svg").read_text())
    rooms = [room for floor in reversed(FLOORS) for room in floor if not room.startswith("__")]
    assert sorted(drawn[: len(rooms)]) == sorted(rooms)
    height = {room: number for number, floor in enumerate(FLOORS) for room in floor}
    assert [height[room] for room in drawn[: len(rooms)]] == sorted((height[room] for room in rooms), reverse=True)


def messages() -> list[str]:
    """The first cells of the tables in docs/troubleshooting.md, without what only explains them."""
    rows = re.findall(r"^\| (?!message |---)(.+?) \|", PAGES["docs/troubleshooting.md"], re.MULTILINE)
    sentences = [re.sub(r" \((?:a warning|`.*?`)\)", "", sentence) for row in rows for sentence in row.split("; ")]
    return [sentence for sentence in sentences if sentence not in SAID_BY_THE_SYSTEM]


SAID_BY_THE_SYSTEM = {"...: No space left on device", "...: Permission denied"}


def literals() -> str:
    """All text in the code of both packages and the tools, names and numbers in it as ``...``."""
    parts = []
    for path in PYTHON:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                parts.append(node.value)
            if isinstance(node, ast.JoinedStr):
                parts.append("".join(part.value if isinstance(part, ast.Constant) else "..." for part in node.values))
    return "\n".join(parts)


def test_messages_with_remedies_are_those_of_the_code():
    text = literals()
    pieces = [(sentence, piece.strip(" ,.:%()")) for sentence in messages() for piece in sentence.split("...")]
    assert [sentence for sentence, piece in pieces if piece not in text] == []


@pytest.mark.parametrize("number", range(1, 15))
def test_every_equation_of_the_paper_has_a_place(number):
    rows = [line for line in PAGES["docs/paper.md"].splitlines() if line.startswith("| Eq. ")]
    ranges = [re.match(r"\| Eq\. (\d+)(?: to (\d+))?", row).groups() for row in rows]
    assert any(int(first) <= number <= int(last or first) for first, last in ranges)


def test_settings_that_the_paper_page_names_exist():
    from karf_engine.project.settings import describe

    known = {name for name, _, _ in describe()}
    named = set(
        re.findall(r"`((?:geometry|segmentation|palette|recoloring)\.[a-z_]+)(?:=[^`]*)?`", PAGES["docs/paper.md"])
    )
    assert named and named <= known
