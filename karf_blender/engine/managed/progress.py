"""How far an installation is, by what uv says and what lies in its cache. No bpy."""

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

BEGUN = re.compile(r"^Downloading (\S+) \(")
FETCHED = re.compile(r"^ Downloaded (\S+)")
PREPARED = re.compile(r"^Prepared \d+ package")


@dataclass(frozen=True)
class Progress:
    """title: what is being done. detail: the packages it is at. done, total: bytes, the first estimated."""

    title: str
    detail: str
    done: int
    total: int

    @property
    def sentence(self) -> str:
        """For people."""
        figures = f", {self.done / 1e6:.0f} of {self.total / 1e6:.0f} MB" if self.done else ""
        return f"{self.title}{figures}{f': {self.detail}' if self.detail else ''}"

    @property
    def fraction(self) -> float:
        """From 0 to 1."""
        return min(self.done / self.total, 1.0) if self.total else 0.0


class Fetching:
    """What uv has fetched. It unpacks while it fetches: how far it is with a file shows in its cache only.

    Args:
        sizes: Bytes of the packages' files by name.
        total: Bytes of all of them.
        cache: uv's cache, where unpacked files lie in `archive-v0` and unfinished ones in `.tmp` folders.
        unpacked: Bytes on disk for each that is fetched.
    """

    def __init__(self, sizes: dict[str, int], total: int, cache: Path, unpacked: float) -> None:
        self._sizes, self._total, self._cache, self._unpacked = sizes, total, cache, unpacked
        self._active: set[str] = set()
        self._finished: set[str] = set()
        self._is_prepared = False
        self._most = 0

    def read(self, lines: Iterable[str]) -> None:
        """Take in what uv has said since the last call."""
        for line in lines:
            if found := BEGUN.match(line):
                self._active.add(found[1])
            elif found := FETCHED.match(line):
                self._active.discard(found[1])
            elif PREPARED.match(line):
                self._is_prepared = True

    @property
    def detail(self) -> str:
        """The largest files that are being fetched."""
        if self._is_prepared:
            return "putting them in place"
        return ", ".join(sorted(self._active, key=lambda name: -self._sizes.get(name, 0))[:3])

    def done(self) -> int:
        """Bytes: those of finished files, also from before, and for the others an estimate by what they have grown to."""
        if self._is_prepared:
            return self._total
        self._finished |= {_package(path) for path in self._cache.glob("archive-v0/*/*.dist-info")}
        finished = sum(self._sizes.get(name, 0) for name in self._finished)
        growing = sum(map(_size, self._cache.glob(".tmp*")))
        # an estimate that proves too high waits for the truth
        self._most = max(self._most, min(finished + round(growing / self._unpacked), self._total))
        return self._most


def _package(info: Path) -> str:
    """The name of the package that a `.dist-info` folder is of, as indexes write it."""
    return re.sub(r"[-_.]+", "-", info.name.partition("-")[0]).lower()


def _size(folder: Path) -> int:
    """Bytes in a folder without headers, which are thousands and small: Blender's window waits for this."""
    count = 0
    for root, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name != "include"]
        for name in names:
            try:
                count += (Path(root) / name).stat().st_size
            except OSError:  # moved to its place meanwhile
                continue
    return count
