"""Pages name what exists: files, links, code, controls, messages, settings; stub and reference are what the code says."""

import ast
import inspect
import re
import subprocess
import sys

import pytest

from blender_tests.engine.conftest import ROOT
from blender_tests.engine.test_layering import FLOORS
from karf_engine.io.options import flag_of
from karf_engine.project.settings import describe
from tools import reference

DOCS = ROOT / "docs"
FILES = [*sorted(ROOT.glob("*.md")), *sorted(DOCS.glob("*.md")), *sorted(DOCS.glob("tasks/*.md"))]
PAGES = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in FILES}
FOR_ARTISTS = [
    "README.md",
    *(f"docs/{name}.md" for name in ("tutorial", "blender", "install", "troubleshooting")),
    *(page for page in PAGES if page.startswith("docs/tasks/")),
]
ABOUT_THE_CODE = {f"docs/{name}.md" for name in ("architecture", "conventions", "extending", "glossary", "paper")}

FENCE = re.compile(r"^ *```.*?^ *```", re.MULTILINE | re.DOTALL)
PROSE = {page: FENCE.sub("", text) for page, text in PAGES.items()}
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
CODE = re.compile(r"`([^`\n]+)`")
# what a page writes of a file: a Python file, a path below a folder of the repository, or a room
SOURCE = re.compile(r"^((?:\w+/)*\w+\.py)(?=$|[:.])")
TOP = r"karf_engine|karf_blender|tools|docs|blender_tests|notebooks|requirements|demo"
BELOW = re.compile(rf"^((?:{TOP})/[\w./-]*)(?=$|:)")
ROOM = re.compile(r"^((?:\w+/)+)$")

TREES = {
    path: ast.parse(path.read_text(encoding="utf-8"))
    for top in ("karf_engine", "karf_blender", "tools")
    for path in (ROOT / top).rglob("*.py")
}
NODES = {path: list(ast.walk(tree)) for path, tree in TREES.items()}
SOURCES = {path.name for path in TREES} | {f"{path.parent.name}/" for path in TREES}
CODE_PLACES = (ROOT, ROOT / "karf_engine", ROOT / "karf_blender", ROOT / "tools")
TEST_PLACES = (ROOT, ROOT / "blender_tests", ROOT / "blender_tests" / "engine")


def names_in(node):
    """Functions and attributes of a module or a class, at any depth."""
    for part in ast.walk(node):
        if isinstance(part, ast.FunctionDef | ast.ClassDef):
            yield part.name
        elif isinstance(part, ast.Attribute):
            yield part.attr
        elif isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
            yield part.id


def literals(top=""):
    """All texts in the code below a folder, names and numbers in them as ``...``."""
    parts = []
    for node in (node for path, nodes in NODES.items() if path.is_relative_to(ROOT / top) for node in nodes):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            parts.append(node.value)
        if isinstance(node, ast.JoinedStr):
            parts.append("".join(part.value if isinstance(part, ast.Constant) else "..." for part in node.values))
    return parts


def anchors(page):
    """The anchors of a page's headings, as GitHub and the site make them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES)
def test_links_and_pictures_of_a_page_exist(page):
    for link in LINK.findall(CODE.sub("", PROSE[page])):
        if "://" in link:
            continue
        name, _, anchor = link.partition("#")
        target = ((ROOT / page).parent / name).resolve() if name else ROOT / page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


def test_every_page_is_in_the_index_once_and_every_picture_on_a_page():
    toctrees = re.findall(r"```\{toctree\}\n(.*?)```", PAGES["docs/index.md"], re.DOTALL)
    names = [line for text in toctrees for line in text.splitlines() if line and not line.startswith((":", "api/"))]
    assert sorted((DOCS / f"{name}.md").resolve() for name in names) == sorted({*FILES} - {DOCS / "index.md"})
    shown = {((ROOT / page).parent / link).resolve() for page, text in PAGES.items() for link in LINK.findall(text)}
    assert set((DOCS / "images").iterdir()) <= shown


@pytest.mark.parametrize("page", PAGES)
def test_files_and_definitions_that_a_page_names_exist(page):
    patterns = (SOURCE, BELOW, ROOM) if page in ABOUT_THE_CODE else (SOURCE, BELOW)
    found = [pattern.match(code) for code in CODE.findall(PROSE[page]) for pattern in patterns]
    for path in {match[1] for match in found if match}:
        places = TEST_PLACES if path.rpartition("/")[2].startswith("test_") else CODE_PLACES
        assert path in SOURCES or any((place / path).exists() for place in places), path
    for module in re.findall(r"-m (tools[a-z_.]*[a-z])\b", PAGES[page]):
        path = ROOT / module.replace(".", "/")
        assert path.is_dir() or path.with_suffix(".py").exists(), module
    for path, names in re.findall(r"`([\w/]+\.py): ([^`]+)`", PAGES[page]):
        file = next((place / path for place in (ROOT / "karf_engine", ROOT) if place / path in TREES), None)
        assert file, f"{path} is not a file"
        defined = {part for name in re.split(r",\s+", names) for part in name.split(".")}
        assert defined <= set(names_in(TREES[file])), path


def test_members_of_classes_that_a_page_names_exist():
    """`Class.member`, where the class is one of the packages'; docs/blender.md speaks of Blender's own."""
    known = {}
    for node in (node for nodes in NODES.values() for node in nodes if isinstance(node, ast.ClassDef)):
        known.setdefault(node.name, set()).update(names_in(node))
    text = "\n".join(text for page, text in PAGES.items() if page != "docs/blender.md")
    named = re.findall(r"`([A-Z]\w+)\.(\w+)\b", text)
    assert [f"{kind}.{name}" for kind, name in named if name not in known.get(kind, {name})] == []


def test_settings_that_a_page_names_exist():
    known = {name for name, _, _ in describe()}
    stages = "geometry|segmentation|palette|recoloring|splats|render"
    named = {name for text in PAGES.values() for name in re.findall(rf"`(?:--set )?((?:{stages})\.[a-z_.]+)[=`]", text)}
    assert [name for name in named - known if not name.endswith((".py", ".json", ".safetensors"))] == []


def test_controls_that_a_page_names_are_those_of_the_panels():
    """Bold names whose words all begin with a capital letter."""
    labels = set(literals("karf_blender"))
    bold = [" ".join(name.split()) for page in FOR_ARTISTS for name in re.findall(r"\*\*([^*]+)\*\*", PROSE[page])]
    names = [name for name in bold if re.fullmatch(r"[A-Z][\w':]*( (in|[A-Z0-9][\w']*))*", name)]
    assert len(names) > 100
    assert [name for name in names if not name.endswith(":") and name not in labels] == []


def test_commands_that_a_page_shows_have_their_options():
    helps = dict(re.findall(r"^## ([a-z-]+)\n```text\n(.*?)```", reference.command_line(), re.MULTILINE | re.DOTALL))
    command = re.compile(r"(?:^|`)(?:karf|python -m karf_engine) ([a-z-]+)([^`\n]*)", re.MULTILINE)
    shown = command.findall("\n".join(PAGES.values()))
    assert len(shown) > 30
    for verb, rest in shown:
        assert verb in helps
        flags = set(re.findall(r"--[a-z-]+", rest.partition("#")[0])) - {"--help"}
        assert flags <= set(re.findall(r"--[a-z-]+", helps[verb])), verb


def test_messages_with_remedies_are_those_of_the_code():
    said_by_the_system = {"...: No space left on device", "...: Permission denied"}
    text = "\n".join(literals())
    rows = re.findall(r"^\| (?!message |---)(.+?) \|", PAGES["docs/troubleshooting.md"], re.MULTILINE)
    sentences = [re.sub(r" \((?:a warning|`.*?`)\)", "", sentence) for row in rows for sentence in row.split("; ")]
    assert len(sentences) > 40
    for sentence in set(sentences) - said_by_the_system:
        assert all(piece.strip(" ,.:%()") in text for piece in sentence.split("...")), sentence


def test_readme_and_cells_of_task_pages_are_short():
    assert len(PROSE["README.md"].split()) <= 700
    for page in [page for page in PAGES if page.startswith("docs/tasks/")]:
        rows = [line for line in PROSE[page].splitlines() if line.startswith("|")]
        assert [cell for row in rows for cell in row.split("|") if len(cell.split()) > 25] == [], page


@pytest.mark.parametrize("page", [*FOR_ARTISTS, "docs/presets.md", "docs/limits.md"])
def test_measured_figures_stand_on_the_benchmark_page_alone(page):
    text = re.sub(r"<!-- figures.*?<!-- /figures -->", "", PROSE[page], flags=re.DOTALL)
    assert re.findall(r"\d (?:dB|CIEDE2000|ms|seconds)\b|(?:IoU|PSNR|CIEDE2000) (?:of )?\d|times faster", text) == []


def test_every_equation_of_the_paper_has_a_place():
    rows = re.findall(r"^\| Eq\. (\d+)(?: to (\d+))?", PAGES["docs/paper.md"], re.MULTILINE)
    assert {n for first, last in rows for n in range(int(first), int(last or first) + 1)} >= set(range(1, 15))


def test_the_drawing_of_the_engine_shows_its_floors_from_the_top():
    """The packages' faces are not rooms of the drawing."""
    drawn = re.findall(r'font-weight="bold">(\w+)</text>', (DOCS / "images" / "architecture.svg").read_text())
    height = {room: number for number, floor in enumerate(FLOORS) for room in floor if not room.startswith("__")}
    rooms = drawn[: len(height)]
    assert sorted(rooms) == sorted(height)
    assert [height[room] for room in rooms] == sorted(height.values(), reverse=True)


def test_the_stub_is_up_to_date_and_types_every_keyword_of_every_function():
    # in a process of its own: here other tests may have registered kinds of fields, heads and layers
    done = subprocess.run([sys.executable, "-m", "tools.reference", "--check"], cwd=ROOT)
    assert done.returncode == 0, "run python -m tools.reference"
    stubs = {node.name: node.args for node in ast.parse(reference.stub()).body if isinstance(node, ast.FunctionDef)}
    assert set(stubs) == set(reference.karf_engine._DEFINES["api"])
    for name, arguments in stubs.items():
        given = [*arguments.args, *arguments.kwonlyargs]
        assert [each.arg for each in given] == list(inspect.signature(getattr(reference.api, name)).parameters), name
        assert all(each.annotation for each in given) and arguments.kwarg is None, name


@pytest.mark.parametrize("kind", reference.COMMANDS.values(), ids=list(reference.COMMANDS))
def test_the_site_has_every_command_with_every_option(kind):
    section = reference.command_line().split(f"## {kind.command}\n")[1].split("\n## ")[0]
    fields = [item for item in reference.fields_in_help_order(kind) if not item.metadata["positional"]]
    assert [flag for flag in map(flag_of, fields) if flag and flag not in section] == []


def test_the_site_has_every_public_name_and_each_has_an_example():
    names = re.findall(r"^### (\w+)$", reference.library(), re.MULTILINE)
    assert sorted(names) == sorted(set(reference.karf_engine.__all__) - {"__version__"})
    documented = {name: inspect.getdoc(getattr(reference.karf_engine, name)) for name in names}
    assert [name for name, text in documented.items() if "Example" not in text] == ["PRESETS"]


def test_the_written_page_lists_every_verb():
    assert re.findall(r"^    ([a-z-]+)(?: |$)", reference._printed("--help"), re.MULTILINE) == [*reference.VERBS]
    rows = re.findall(r"^\| (`.*?`) \|", PAGES["docs/command_line.md"], re.MULTILINE)
    assert sorted(re.findall(r"`([\w-]+)`", "".join(rows))) == sorted(reference.VERBS)
