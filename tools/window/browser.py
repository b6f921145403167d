"""Drive a browser, to test and show the web pages of `karf export-page`.

Needs Node, the packages of `python3 tools/dev.py page`, and Chromium or Firefox; Firefox needs Xvfb as well.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from .screen import SOFTWARE, System, virtual_screen

WEB = Path(__file__).resolve().parents[2] / "karf_engine" / "export" / "page" / "web"
PROGRAMS = {"chromium": ("chromium", "google-chrome"), "firefox": ("firefox-esr", "firefox")}


class Unavailable(Exception):
    """A program or package that a browser needs is missing."""


class Browser:
    """A browser that shows one page at a time."""

    def __init__(self, name: str, process: subprocess.Popen) -> None:
        self.name, self._process = name, process

    def tell(self, command: str, **values: Any) -> Any:
        """Carry out a command of drive.mjs, and return its value."""
        print(json.dumps({"command": command, **values}), file=self._process.stdin, flush=True)
        line = self._process.stdout.readline() if self._process.stdout else ""
        answer = json.loads(line) if line else {"error": "the browser's script has ended"}
        assert "error" not in answer, answer["error"]
        return answer.get("value")

    def open(self, url: str, width: int = 480, height: int = 320, dark: bool | None = None, before: str = "") -> float:
        """Open a page, and return the seconds until it shows its scene or its stills. before: script that runs first."""
        return self.tell("open", url=url, width=width, height=height, dark=dark, before=before)

    def run(self, script: str) -> Any:
        """Return the value of an expression on the page; promises are awaited."""
        return self.tell("run", script=script)

    def shoot(self, path: Path) -> None:
        """Save what the page shows as PNG."""
        self.tell("shoot", path=str(path))


@contextmanager
def open_browser(name: str, folder: Path) -> Iterator[Browser]:
    """Start `chromium` or `firefox`; folder: an empty one for the screen's files. Raises Unavailable."""
    executable = next(filter(None, map(shutil.which, PROGRAMS[name])), None)
    node = shutil.which("node")
    if node is None or not (WEB / "node_modules" / "puppeteer-core").is_dir() or executable is None:
        raise Unavailable(f"needs Node, the packages of `python3 tools/dev.py page`, and {name}")
    screen = nullcontext("")
    if name == "firefox":  # draws no WebGL without a screen
        if shutil.which("Xvfb") is None:
            raise Unavailable("needs Xvfb")
        screen = virtual_screen(System("", None, ()), folder)
    with screen as display:
        command = [node, str(Path(__file__).with_name("drive.mjs")), str(WEB / "package.json"), name, executable]
        variables = os.environ | SOFTWARE | ({"DISPLAY": display} if display else {})
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=variables) as run:
            yield Browser(name, run)
            if run.stdin:
                run.stdin.close()  # ends the script and its browser
            run.wait(60)
