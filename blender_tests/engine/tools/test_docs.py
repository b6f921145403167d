"""README.md and the pages under docs/ name what exists: files, links, pictures, code, controls, messages, settings."""

import ast
import re
from pathlib import Path

import pytest

from blender_tests.engine.conftest import ROOT
from blender_tests.engine.test_layering import FLOORS

DOCS = ROOT / "docs"
FILES = [*sorted(ROOT.glob("*.md")), *sorted(DOCS.glob("*.md")), *sorted(DOCS.glob("tasks/*.md"))]
PAGES = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in FILES}
TASKS = [page for page in PAGES if page.startswith("docs/tasks/")]
FOR_ARTISTS = [
    "README.md",
    *(f"docs/{name}.md" for name in ("tutorial", "blender", "install", "troubleshooting")),
    *TASKS,
]
ABOUT_THE_CODE = {f"docs/{name}.md" for name in ("architecture", "conventions", "extending", "glossary", "paper")}

FENCE = re.compile(r"^ *```.*?^ *```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
CODE = re.compile(r"`([^`\n]+)`")
# what a page writes of a file: a Python file, a path below a folder of the repository, or a room
SOURCE = re.compile(r"^((?:\w+/)*\w+\.py)(?=$|[:.])")
TOP = r"karf_engine|karf_blender|tools|docs|blender_tests|notebooks|requirements|demo"
BELOW = re.compile(rf"^((?:{TOP})/[\w./-]*)(?=$|:)")
ROOM = re.compile(r"^((?:\w+/)+)$")
DEFINED_IN = re.compile(r"`([\w/]+\.py): ([^`]+)`")

TREES = {
    path: ast.parse(path.read_text(encoding="utf-8"))
    for top in ("karf_engine", "karf_blender", "tools")
    for path in (ROOT / top).rglob("*.py")
}
NODES = {path: list(ast.walk(tree)) for path, tree in TREES.items()}
SOURCES = {path.name for path in TREES} | {f"{path.parent.name}/" for path in TREES}
CODE_PLACES = (ROOT, ROOT / "karf_engine", ROOT / "karf_blender", ROOT / "tools")
TEST_PLACES = (ROOT / "blender_tests", ROOT / "blender_tests" / "engine")


def prose(page: str) -> str:
    """A page without its blocks of code."""
    return FENCE.sub("", PAGES[page])


def defined(path: Path) -> set[str]:
    """Functions, classes, constants, and `Class.method` of a file."""
    names = set()
    for node in TREES[path].body:
        if isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {part.id for target in targets for part in ast.walk(target) if isinstance(part, ast.Name)}
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{part.name}" for part in node.body if isinstance(part, ast.FunctionDef)}
    return names


def members() -> dict[str, set[str]]:
    """What each class of the packages has, by its name: methods, attributes, and what its methods set."""
    found = {}
    for node in (node for nodes in NODES.values() for node in nodes if isinstance(node, ast.ClassDef)):
        parts = list(ast.walk(node))
        names = {part.name for part in parts if isinstance(part, ast.FunctionDef)}
        names |= {part.id for part in parts if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)}
        names |= {part.attr for part in parts if isinstance(part, ast.Attribute)}
        found.setdefault(node.name, set()).update(names)
    return found


def literals(top: str = "") -> list[str]:
    """All texts in the code below a folder, names and numbers in them as ``...``."""
    parts = []
    for node in (node for path, nodes in NODES.items() if path.is_relative_to(ROOT / top) for node in nodes):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            parts.append(node.value)
        if isinstance(node, ast.JoinedStr):
            parts.append("".join(part.value if isinstance(part, ast.Constant) else "..." for part in node.values))
    return parts


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub and the site make them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES)
def test_links_and_pictures_of_a_page_are_there(page):
    for link in LINK.findall(CODE.sub("", prose(page))):
        if "://" in link:
            continue
        name, _, anchor = link.partition("#")
        target = ((ROOT / page).parent / name).resolve() if name else ROOT / page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


def test_the_index_lists_every_page_once():
    toctrees = re.findall(r"```\{toctree\}\n(.*?)```", PAGES["docs/index.md"], re.DOTALL)
    names = [line for text in toctrees for line in text.splitlines() if line and not line.startswith((":", "api/"))]
    assert sorted((DOCS / f"{name}.md").resolve() for name in names) == sorted({*FILES} - {DOCS / "index.md"})


def test_every_picture_is_shown_by_a_page():
    shown = {((ROOT / page).parent / link).resolve() for page, text in PAGES.items() for link in LINK.findall(text)}
    assert set((DOCS / "images").iterdir()) <= shown


@pytest.mark.parametrize("page", PAGES)
def test_files_that_a_page_names_exist(page):
    patterns = (SOURCE, BELOW, ROOM) if page in ABOUT_THE_CODE else (SOURCE, BELOW)
    found = [pattern.match(code) for code in CODE.findall(prose(page)) for pattern in patterns]
    for path in {match[1] for match in found if match}:
        places = TEST_PLACES if path.rpartition("/")[2].startswith("test_") else CODE_PLACES
        assert path in SOURCES or any((place / path).exists() for place in (*places, ROOT)), path
    for module in re.findall(r"-m (tools[a-z_.]*[a-z])\b", PAGES[page]):
        path = ROOT / module.replace(".", "/")
        assert path.is_dir() or path.with_suffix(".py").exists(), module


def test_what_a_page_says_a_file_defines_is_there():
    named = [(page, *match) for page, text in PAGES.items() for match in DEFINED_IN.findall(text)]
    assert named
    for page, path, names in named:
        file = next((place / path for place in (ROOT / "karf_engine", ROOT) if place / path in TREES), None)
        assert file, f"{page} names {path}, which is not a file"
        assert set(re.split(r",\s+", names)) <= defined(file), f"{page}: {path}"


def test_members_of_classes_that_a_page_names_exist():
    """`Class.member`, where the class is one of the packages'; docs/blender.md speaks of Blender's own."""
    known = members()
    pages = [(page, text) for page, text in PAGES.items() if page != "docs/blender.md"]
    named = [(page, *name) for page, text in pages for name in re.findall(r"`([A-Z]\w+)\.(\w+)\b", text)]
    assert [name for name in named if name[1] in known and name[2] not in known[name[1]]] == []


def test_settings_that_a_page_names_exist():
    from karf_engine.project.settings import describe

    known = {name for name, _, _ in describe()}
    stages = "geometry|segmentation|palette|recoloring|splats|render"
    named = {name for text in PAGES.values() for name in re.findall(rf"`(?:--set )?((?:{stages})\.[a-z_.]+)[=`]", text)}
    files = re.compile(r".*\.(py|json|safetensors)")
    assert [name for name in sorted(named - known) if not files.fullmatch(name)] == []


def test_controls_that_a_page_names_are_those_of_the_panels():
    """Bold names whose words all begin with a capital letter."""
    labels = set(literals("karf_blender"))
    bold = [
        (page, " ".join(name.split())) for page in FOR_ARTISTS for name in re.findall(r"\*\*([^*]+)\*\*", prose(page))
    ]
    names = [(page, name) for page, name in bold if re.fullmatch(r"[A-Z][\w':]*( (in|[A-Z0-9][\w']*))*", name)]
    assert len(names) > 100
    assert [(page, name) for page, name in names if not name.endswith(":") and name not in labels] == []


COMMAND = re.compile(r"(?:^|`)(?:karf|python -m karf_engine) ([a-z-]+)([^`\n]*)", re.MULTILINE)


def test_commands_that_a_page_shows_have_their_options():
    from tools import reference

    helps = dict(re.findall(r"^## ([a-z-]+)\n```text\n(.*?)```", reference.command_line(), re.MULTILINE | re.DOTALL))
    shown = [(page, *found) for page, text in PAGES.items() for found in COMMAND.findall(text)]
    assert len(shown) > 30
    for page, verb, rest in shown:
        assert verb in helps, (page, verb)
        flags = set(re.findall(r"--[a-z-]+", rest.partition("#")[0])) - {"--help"}
        assert flags <= set(re.findall(r"--[a-z-]+", helps[verb])), (page, verb)


SAID_BY_THE_SYSTEM = {"...: No space left on device", "...: Permission denied"}


def test_messages_with_remedies_are_those_of_the_code():
    text = "\n".join(literals())
    rows = re.findall(r"^\| (?!message |---)(.+?) \|", PAGES["docs/troubleshooting.md"], re.MULTILINE)
    sentences = [re.sub(r" \((?:a warning|`.*?`)\)", "", sentence) for row in rows for sentence in row.split("; ")]
    assert len(sentences) > 40
    for sentence in set(sentences) - SAID_BY_THE_SYSTEM:
        assert all(piece.strip(" ,.:%()") in text for piece in sentence.split("...")), sentence


@pytest.mark.parametrize("page", TASKS)
def test_cells_of_tables_are_short(page):
    rows = [line for line in PAGES[page].splitlines() if line.startswith("|")]
    assert [cell for row in rows for cell in row.split("|") if len(cell.split()) > 25] == []


def test_the_readme_is_short():
    assert len(PAGES["README.md"].split()) <= 700


@pytest.mark.parametrize("page", [*FOR_ARTISTS, "docs/presets.md", "docs/limits.md"])
def test_measured_figures_stand_on_the_benchmark_page_alone(page):
    text = re.sub(r"<!-- figures.*?<!-- /figures -->", "", prose(page), flags=re.DOTALL)
    assert re.findall(r"\d (?:dB|CIEDE2000|s|ms|seconds)\b|(?:IoU|PSNR|CIEDE2000) (?:of )?\d|times faster", text) == []


def test_the_drawing_of_the_engine_shows_its_floors_from_the_top():
    """The packages' faces are not rooms of the drawing."""
    drawn = re.findall(r'font-weight="bold">(\w+)</text>', (DOCS / "images" / "architecture.svg").read_text())
    height = {room: number for number, floor in enumerate(FLOORS) for room in floor if not room.startswith("__")}
    rooms = drawn[: len(height)]
    assert sorted(rooms) == sorted(height)
    assert [height[room] for room in rooms] == sorted(height.values(), reverse=True)


@pytest.mark.parametrize("number", range(1, 15))
def test_every_equation_of_the_paper_has_a_place(number):
    rows = [line for line in PAGES["docs/paper.md"].splitlines() if line.startswith("| Eq. ")]
    ranges = [re.match(r"\| Eq\. (\d+)(?: to (\d+))?", row).groups() for row in rows]
    assert any(int(first) <= number <= int(last or first) for first, last in ranges)
