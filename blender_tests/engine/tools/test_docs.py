"""Pages name only existing files, code, controls, messages and settings; stub and reference are current."""

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
from tools import devices, opens, reference

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
# forms of paths on pages: a Python file, a path below one of the top folders, a folder
SOURCE = re.compile(r"^((?:\w+/)*\w+\.py)(?=$|[:.])")
TOP = r"karf_engine|karf_blender|tools|docs|blender_tests|notebooks|requirements|demo"
BELOW = re.compile(rf"^((?:{TOP})/[\w./-]*)(?=$|:)")
FOLDER = re.compile(r"^((?:\w+/)+)$")

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
    """Names of functions, classes, attributes and variables in a module or class, at any depth."""
    for part in ast.walk(node):
        if isinstance(part, ast.FunctionDef | ast.ClassDef):
            yield part.name
        elif isinstance(part, ast.Attribute):
            yield part.attr
        elif isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
            yield part.id


def literals(top=""):
    """All texts in the code below a folder, with inserted values as ``...``."""
    for node in (node for path, nodes in NODES.items() if path.is_relative_to(ROOT / top) for node in nodes):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
        if isinstance(node, ast.JoinedStr):
            yield "".join(part.value if isinstance(part, ast.Constant) else "..." for part in node.values)


def anchors(page):
    """The anchors of a page's headings, as on GitHub and the site."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES)
def test_links_of_a_page_exist(page):
    for link in LINK.findall(CODE.sub("", PROSE[page])):
        if "://" in link:
            continue
        name, _, anchor = link.partition("#")
        target = ((ROOT / page).parent / name).resolve() if name else ROOT / page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


def test_pages_are_indexed_and_pictures_shown():
    toctrees = re.findall(r"```\{toctree\}\n(.*?)```", PAGES["docs/index.md"], re.DOTALL)
    names = [line for text in toctrees for line in text.splitlines() if line and not line.startswith((":", "api/"))]
    assert sorted((DOCS / f"{name}.md").resolve() for name in names) == sorted({*FILES} - {DOCS / "index.md"})
    shown = {((ROOT / page).parent / link).resolve() for page, text in PAGES.items() for link in LINK.findall(text)}
    assert set((DOCS / "images").iterdir()) <= shown


@pytest.mark.parametrize("page", PAGES)
def test_named_files_and_definitions_exist(page):
    patterns = (SOURCE, BELOW, FOLDER) if page in ABOUT_THE_CODE else (SOURCE, BELOW)
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


def test_named_class_members_exist():
    """`Class.member` of our classes; docs/blender.md names Blender's."""
    known = {}
    for node in (node for nodes in NODES.values() for node in nodes if isinstance(node, ast.ClassDef)):
        known.setdefault(node.name, set()).update(names_in(node))
    text = "\n".join(text for page, text in PAGES.items() if page != "docs/blender.md")
    named = re.findall(r"`([A-Z]\w+)\.(\w+)\b", text)
    assert [f"{kind}.{name}" for kind, name in named if name not in known.get(kind, {name})] == []


def test_named_settings_exist():
    known = {name for name, _, _ in describe()}
    stages = "geometry|segmentation|palette|recoloring|splats|render"
    named = {name for text in PAGES.values() for name in re.findall(rf"`(?:--set )?((?:{stages})\.[a-z_.]+)[=`]", text)}
    assert [name for name in named - known if not name.endswith((".py", ".json", ".safetensors"))] == []


def test_named_controls_exist():
    """Controls are bold names whose words are capitalized."""
    labels = set(literals("karf_blender"))
    bold = [" ".join(name.split()) for page in FOR_ARTISTS for name in re.findall(r"\*\*([^*]+)\*\*", PROSE[page])]
    names = [name for name in bold if re.fullmatch(r"[A-Z][\w':]*( (in|[A-Z0-9][\w']*))*", name)]
    assert len(names) > 100
    assert [name for name in names if not name.endswith(":") and name not in labels] == []


def test_shown_commands_and_options_exist():
    helps = dict(re.findall(r"^## ([a-z-]+)\n```text\n(.*?)```", reference.command_line(), re.MULTILINE | re.DOTALL))
    command = re.compile(r"(?:^|`)(?:karf|python -m karf_engine) ([a-z-]+)([^`\n]*)", re.MULTILINE)
    shown = command.findall("\n".join(PAGES.values()))
    assert len(shown) > 30
    for verb, rest in shown:
        assert verb in helps
        flags = set(re.findall(r"--[a-z-]+", rest.partition("#")[0])) - {"--help"}
        assert flags <= set(re.findall(r"--[a-z-]+", helps[verb])), verb


def test_troubleshooting_messages_exist_in_the_code():
    system_messages = {"...: No space left on device", "...: Permission denied"}
    text = "\n".join(literals())
    rows = re.findall(r"^\| (?!message |---)(.+?) \|", PAGES["docs/troubleshooting.md"], re.MULTILINE)
    sentences = [re.sub(r" \((?:a warning|`.*?`)\)", "", sentence) for row in rows for sentence in row.split("; ")]
    assert len(sentences) > 40
    for sentence in set(sentences) - system_messages:
        assert all(piece.strip(" ,.:%()") in text for piece in sentence.split("...")), sentence


def test_readme_and_task_tables_are_short():
    assert len(PROSE["README.md"].split()) <= 700
    for page in [page for page in PAGES if page.startswith("docs/tasks/")]:
        rows = [line for line in PROSE[page].splitlines() if line.startswith("|")]
        assert [cell for row in rows for cell in row.split("|") if len(cell.split()) > 25] == [], page


@pytest.mark.parametrize("page", [*FOR_ARTISTS, "docs/presets.md", "docs/limits.md"])
def test_only_the_benchmark_page_has_measured_figures(page):
    text = re.sub(r"<!-- figures.*?<!-- /figures -->", "", PROSE[page], flags=re.DOTALL)
    assert re.findall(r"\d (?:dB|CIEDE2000|ms|seconds)\b|(?:IoU|PSNR|CIEDE2000) (?:of )?\d|times faster", text) == []


def test_every_equation_of_the_paper_is_mapped():
    rows = re.findall(r"^\| Eq\. (\d+)(?: to (\d+))?", PAGES["docs/paper.md"], re.MULTILINE)
    assert {n for first, last in rows for n in range(int(first), int(last or first) + 1)} >= set(range(1, 15))


def test_architecture_drawing_shows_all_floors_in_order():
    """The packages' own files are not drawn."""
    drawn = re.findall(r'font-weight="bold">(\w+)</text>', (DOCS / "images" / "architecture.svg").read_text())
    height = {room: number for number, floor in enumerate(FLOORS) for room in floor if not room.startswith("__")}
    rooms = drawn[: len(height)]
    assert sorted(rooms) == sorted(height)
    assert [height[room] for room in rooms] == sorted(height.values(), reverse=True)


def test_page_of_what_opens_is_current():
    assert opens.PAGE.read_text(encoding="utf-8") == opens.page(), "run python -m tools.opens"


def test_stub_is_current_and_types_every_argument():
    # in another process, since other tests may have registered fields, heads and layers here
    done = subprocess.run([sys.executable, "-m", "tools.reference", "--check"], cwd=ROOT)
    assert done.returncode == 0, "run python -m tools.reference"
    stubs = {node.name: node.args for node in ast.parse(reference.stub()).body if isinstance(node, ast.FunctionDef)}
    assert set(stubs) == set(reference.karf_engine._DEFINES["api"])
    for name, arguments in stubs.items():
        given = [*arguments.args, *arguments.kwonlyargs]
        assert [each.arg for each in given] == list(inspect.signature(getattr(reference.api, name)).parameters), name
        assert all(each.annotation for each in given) and arguments.kwarg is None, name


@pytest.mark.parametrize("kind", reference.COMMANDS.values(), ids=list(reference.COMMANDS))
def test_site_lists_every_option_of_every_command(kind):
    section = reference.command_line().split(f"## {kind.command}\n")[1].split("\n## ")[0]
    fields = [item for item in reference.fields_in_help_order(kind) if not item.metadata["positional"]]
    assert [flag for flag in map(flag_of, fields) if flag and flag not in section] == []


def test_site_lists_every_public_name_with_an_example():
    names = re.findall(r"^### (\w+)$", reference.library(), re.MULTILINE)
    assert sorted(names) == sorted(set(reference.karf_engine.__all__) - {"__version__"})
    documented = {name: inspect.getdoc(getattr(reference.karf_engine, name)) for name in names}
    assert [name for name, text in documented.items() if "Example" not in text] == ["PRESETS"]


def test_command_line_page_lists_every_verb():
    assert re.findall(r"^    ([a-z-]+)(?: |$)", reference._printed("--help"), re.MULTILINE) == [*reference.VERBS]
    rows = re.findall(r"^\| (`.*?`) \|", PAGES["docs/command_line.md"], re.MULTILINE)
    assert sorted(re.findall(r"`([\w-]+)`", "".join(rows))) == sorted(reference.VERBS)


def test_page_of_devices_is_current():
    assert devices.PAGE.read_text(encoding="utf-8") == devices.page(), "run python -m tools.devices"


def test_page_of_devices_counts_the_outcomes_of_a_report():
    assert len(devices.marked()) >= 14 and all("| never |" in row for row in devices.table(None).splitlines()[4:])
    file = "blender_tests/engine/splats/test_gsplat.py::test_"
    outcomes = {
        "training_steps_match_the_kernels": "passed",
        "faded_colors_match_the_kernels": "failed",
        "else": "failed",
    }
    tests = {file + name: {"outcome": outcome} for name, outcome in outcomes.items()}
    found = devices.table({"hardware": "a card", "torch": "2.13", "tests": tests})
    assert "test_gsplat.py` | 1 failed, 1 passed |" in found and devices.NEVER not in found
