"""Web pages in real browsers. Skipped without Node, the built viewer, or a browser.

KARF_PAGE_PROJECT tests the page of another learned project than the still life.
"""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from blender_tests.engine.conftest import learned, still_life  # noqa: F401  fixtures
from blender_tests.engine.export.page.conftest import imported  # noqa: F401
from tools.window.browser import PROGRAMS, WEB, Browser, Unavailable, open_browser


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
    try:
        with open_browser(request.param, tmp_path_factory.mktemp("screen")) as browser:
            yield browser
    except Unavailable as missing:
        pytest.skip(str(missing))


@pytest.fixture(scope="session")
def viewer() -> None:
    """The built viewer and the packages that export a page, or the test is skipped."""
    pytest.importorskip("numba")
    pytest.importorskip("gsply")
    if not (WEB / "dist" / "page.js").is_file():
        pytest.skip("needs the viewer: python3 tools/dev.py page")


@pytest.fixture(scope="session")
def imported_page(viewer, imported, tmp_path_factory) -> Iterator[Pages]:  # noqa: F811
    """The page of splats of another program, with a look."""
    import karf_engine as karf

    folder = tmp_path_factory.mktemp("imported_page")
    karf.load(imported, "cpu").edit().becomes("ball", "#b5302c", "#3059b8").save(folder / "Blue.json")
    karf.export_page(imported, folder / "page", looks=[folder / "Blue.json"], threads=1)
    with served(folder / "page") as url:
        yield Pages(imported, folder / "page", url, "")


@pytest.fixture(scope="session")
def pages(viewer, request, tmp_path_factory) -> Iterator[Pages]:
    """The page of a learned scene with a look of each kind."""
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
