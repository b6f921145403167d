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
    """What one run of uv has fetched. It unpacks while it fetches: how far it is with a file shows in its cache only.

    Args:
        sizes: Bytes of the packages' files by name.
        total: Bytes of all of them.
        cache: uv's cache.
        unpacked: Bytes on disk for each that is fetched.
    """

    def __init__(self, sizes: dict[str, int], total: int, cache: Path, unpacked: float) -> None:
        self._sizes, self._total, self._cache, self._unpacked = sizes, total, cache, unpacked
        self._active: set[str] = set()
        self._done: set[str] = set()
        self._is_prepared = False

    def read(self, lines: Iterable[str]) -> None:
        """Take in what uv has said since the last call."""
        for line in lines:
            if found := BEGUN.match(line):
                self._active.add(found[1])
            elif found := FETCHED.match(line):
                self._active.discard(found[1])
                self._done.add(found[1])
            elif PREPARED.match(line):
                self._is_prepared = True

    @property
    def detail(self) -> str:
        return ", ".join(sorted(self._active, key=lambda name: -self._sizes.get(name, 0))[:3])

    @property
    def done(self) -> int:
        """Bytes, estimated: those of finished files, and for the others what they have grown to."""
        if self._is_prepared:
            return self._total
        finished = sum(self._sizes.get(name, 0) for name in self._done)
        return min(finished + round(self._growing() / self._unpacked), self._total)

    def _growing(self) -> int:
        """Bytes of what is being unpacked."""
        folders = [path for path in _listed(self._cache) if path.name.startswith(".tmp")]
        return sum(_size(folder) for folder in folders)


def _listed(folder: Path) -> list[Path]:
    try:
        return list(folder.iterdir())
    except OSError:
        return []


def _size(folder: Path) -> int:
    count = 0
    for root, _, names in os.walk(folder):
        for name in names:
            try:
                count += (Path(root) / name).stat().st_size
            except OSError:  # moved to its place meanwhile
                continue
    return count
