"""Web pages in real browsers. Skipped without Node, the built viewer, or a browser; see drive.mjs.

KARF_PAGE_PROJECT tests the page of another learned project than the still life.
"""

import json
import os
import shutil
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from blender_tests.engine.conftest import learned, still_life  # noqa: F401  fixtures
from tools.window.screen import SOFTWARE, System, virtual_screen

ROOT = Path(__file__).resolve().parents[2]
WEB = ROOT / "karf_engine" / "export" / "page" / "web"
PROGRAMS = {"chromium": ("chromium", "google-chrome"), "firefox": ("firefox-esr", "firefox")}


class Browser:
    """A browser that shows one page at a time."""

    def __init__(self, name: str, process: subprocess.Popen) -> None:
        self.name, self._process = name, process

    def tell(self, command: str, **values: Any) -> Any:
        """Carry out a command of drive.mjs, and return its value."""
        print(json.dumps({"command": command, **values}), file=self._process.stdin, flush=True)
        line = self._process.stdout.readline()
        answer = json.loads(line) if line else {"error": "the browser's script has ended"}
        assert "error" not in answer, answer["error"]
        return answer.get("value")

    def open(self, url: str, width: int = 480, height: int = 320, dark: bool | None = None, before: str = "") -> float:
        """Open a page, and return the seconds until it shows its scene or its stills. before: script that runs first."""
        return self.tell("open", url=url, width=width, height=height, dark=dark, before=before)

    def run(self, script: str) -> Any:
        """Return the value of an expression on the page; promises are awaited."""
        return self.tell("run", script=script)


@dataclass(frozen=True)
class Pages:
    """A project's page as folder and as one file."""

    project: Path
    folder: Path
    url: str  # of the folder
    single: str  # of the file


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *arguments: object) -> None:
        pass


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """Serve a folder on loopback, and yield its address."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()
        thread.join()


@pytest.fixture(scope="module", params=list(PROGRAMS))
def browser(request, tmp_path_factory) -> Iterator[Browser]:
    """Each browser that is installed."""
    name = request.param
    executable = next(filter(None, map(shutil.which, PROGRAMS[name])), None)
    node = shutil.which("node")
    if node is None or not (WEB / "node_modules" / "puppeteer-core").is_dir() or executable is None:
        pytest.skip(f"needs Node, the packages of `python3 tools/dev.py page`, and {name}")
    screen = nullcontext("")
    if name == "firefox":  # draws no WebGL without a screen
        if shutil.which("Xvfb") is None:
            pytest.skip("needs Xvfb")
        screen = virtual_screen(System("", None, ()), tmp_path_factory.mktemp("screen"))
    with screen as display:
        command = [node, str(Path(__file__).with_name("drive.mjs")), str(WEB / "package.json"), name, executable]
        variables = os.environ | SOFTWARE | ({"DISPLAY": display} if display else {})
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=variables) as run:
            yield Browser(name, run)
            run.stdin.close()  # ends the script and its browser
            run.wait(60)


@pytest.fixture(scope="session")
def pages(request, tmp_path_factory) -> Iterator[Pages]:
    """The page of a learned scene with a look of each kind."""
    pytest.importorskip("numba")
    pytest.importorskip("gsply")
    if not (WEB / "dist" / "page.js").is_file():
        pytest.skip("needs the viewer: python3 tools/dev.py page")
    import karf_engine as karf

    chosen = os.environ.get("KARF_PAGE_PROJECT")
    project = Path(chosen) if chosen else request.getfixturevalue("learned").project
    folder, looks = tmp_path_factory.mktemp("pages"), tmp_path_factory.mktemp("looks")
    palettes = karf.load(project, "cpu").palettes
    edit = karf.load(project, "cpu").edit()
    first, last = palettes[0], palettes[-1]
    edit.becomes(last.name, last.colors[1], "#3059b8").save(looks / "Harbor.json")
    edit.swatch(first.name, 1, (1.4, 1.2, 0.2)).save(looks / "Bright.json")
    edit.add_color(first.name, first.colors[1], "#e0559a").edge(last.name, 1.0, 1.0).save(looks / "Berry.json")
    options: Any = {
        "looks": sorted(looks.iterdir()),
        "title": "Still life",
        "studio": "Atelier Nord",
        "locked": [f"{last.name}/1"],
        "threads": 1,
    }
    karf.export_page(project, folder / "page", **options)
    karf.export_page(project, folder / "single", single=True, **options)
    with served(folder / "page") as url:
        yield Pages(project, folder / "page", url, (folder / "single" / "index.html").as_uri())
