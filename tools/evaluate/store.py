"""Scenes drawn and learned for the tables, kept between runs as long as the modules that made them stay the same."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..dev import python_of
from .sources import ROOT, Trace, changed, digests

RECORD = "made.json"  # {"sources": {module: digest}, "result": whatever `make` returned}


class Store:
    """Folders of results below one folder, each with the modules that it was made by.

    Attributes:
        folder: of everything that is kept.
        threads: processor threads of all learning.
        trace: the modules that have run since this process began.
        sources: digests of the modules behind all results that were taken out so far.
    """

    def __init__(self, folder: Path, threads: int = 1) -> None:
        self.folder = folder.absolute()
        self.threads = threads
        self.trace = Trace()
        self.sources: dict[str, str] = {}

    def path(self, name: str) -> Path:
        """Return where a result lies."""
        return self.folder / name

    def is_current(self, name: str) -> bool:
        """Test whether a result is there, and made by the modules as they are now."""
        record = self._record(name)
        return bool(record) and not changed(record["sources"])

    def take(self, name: str, make: Callable[[Path], Any]) -> Any:
        """Return the result of that name, made by `make(folder)` unless it is current; JSON values only."""
        if not self.is_current(name):
            self._make(name, make)
        record = self._record(name)
        self.sources |= record["sources"]
        return record["result"]

    def all_sources(self) -> dict[str, str]:
        """Return the digests of the modules that ran since this process began, and of those behind all results taken out."""
        return digests(self.trace.modules()) | self.sources

    def _record(self, name: str) -> dict[str, Any]:
        file = self.path(name) / RECORD
        return json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}

    def _make(self, name: str, make: Callable[[Path], Any]) -> None:
        """Make a result; what was traced and taken before does not count as its sources."""
        folder, before = self.path(name), (self.trace.files, self.sources)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        self.trace.files, self.sources = set(), {}
        result = make(folder)
        record = {"sources": self.all_sources(), "result": result}
        (folder / RECORD).write_text(json.dumps(record, indent=1), encoding="utf-8")
        self.trace.files, self.sources = before

    def run_in_blender(self, module: str, *arguments: str) -> None:
        """Run a module in the environment that has Blender; the modules it lists as its sources count as run here."""
        listed = self.folder / f"{module}.sources.json"
        command = [str(python_of("blender")), "-m", module, *arguments, "--sources", str(listed)]
        subprocess.run(command, cwd=ROOT, check=True)
        self.trace.files |= {str(ROOT / name) for name in json.loads(listed.read_text(encoding="utf-8"))}
        listed.unlink()
