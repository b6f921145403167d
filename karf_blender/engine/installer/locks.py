"""Lock files: the packages of the engine's environment, with sizes and hashes. No bpy.

`python3 tools/dev.py lock` writes `requirements/<system>-<build of torch>.txt` in pip's format.
"""

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ...engine_api import MissingDependency

FOLDER = Path(__file__).with_name("requirements")
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
BUILDS = ("auto", "cpu", "cuda", "rocm", "mps")  # of torch


@dataclass(frozen=True)
class Wheel:
    """A package's file. One without hash is known by its version alone: its name is a pattern, its size estimated."""

    file: str
    size: int  # bytes
    name: str
    version: str
    sha256: str = ""

    @property
    def requirement(self) -> str:
        return f"{self.name}=={self.version} --hash=sha256:{self.sha256}"

    def find(self, folder: Path, python: str = "") -> Path | None:
        tag = f"-cp{python.replace('.', '')}-" if python and not self.sha256 else ""
        return next((path for path in folder.glob(self.file) if tag in path.name), None)


@dataclass(frozen=True)
class Lock:
    build: str
    files: tuple[Path, ...]  # requirements
    wheels: tuple[Wheel, ...]  # for its Python

    @property
    def torch(self) -> Wheel:
        return next(wheel for wheel in self.wheels if wheel.name == "torch")

    @property
    def bytes(self) -> int:
        return sum(wheel.size for wheel in self.wheels)

    @property
    def digest(self) -> str:
        """A fingerprint; an environment with another one is outdated."""
        lines = sorted(wheel.sha256 for wheel in self.wheels if wheel.sha256)
        return hashlib.sha256("\n".join([*lines, self.torch.version, self.build]).encode()).hexdigest()


@cache
def read(platform: str, build: str, python: str, extras: Sequence[str] = ()) -> Lock:
    """Read what an environment for a system, a build of torch and a Python (`3.11`) has; raises MissingDependency."""
    files = tuple(lock_file(platform, name) for name in (build, *sorted(extras)))
    if not files[0].is_file():
        sentence = f"KaRF knows no engine for {platform}."
        raise MissingDependency(sentence, "Make an environment by hand and set Engine Python to it.")
    if python not in PYTHONS:
        sentence = f"KaRF knows no engine for Python {python} on {platform}."
        raise MissingDependency(sentence, f"Use Python {' or '.join(PYTHONS)}.")
    for extra, file in zip(sorted(extras), files[1:], strict=True):
        if not file.is_file():
            raise MissingDependency(f"{extra} cannot be had for Python {python} on {platform}.", "Untick it.")
    return Lock(build, files, tuple(wheel for file in files for wheel in _wheels(file) if _fits(wheel, python)))


def read_uv(platform: str) -> Wheel:
    system, _, processor = platform.partition("-")
    tag = {"linux": "manylinux", "windows": "win", "macos": "macosx"}[system]
    kind = "amd64" if system == "windows" else processor
    return next(wheel for wheel in _wheels(FOLDER / "uv.txt") if tag in wheel.file and kind in wheel.file)


def lock_file(platform: str, name: str) -> Path:
    return FOLDER / f"{platform}-{name}.txt"


def _wheels(file: Path) -> Iterator[Wheel]:
    """The files of all Pythons; comments above a package name them in the order of its hashes."""
    text = file.read_text(encoding="utf-8")
    for found in re.finditer(r"((?:# \S+\.whl \d+\n)+)(\S+)==(\S+)((?: \\\n +--hash=\S+)*)", text):
        comments, name, version, rest = found.groups()
        hashes = re.findall(r"sha256:(\w+)", rest) or [""]
        for comment, sha256 in zip(comments.splitlines(), hashes, strict=True):
            _, wheel, size = comment.split()
            yield Wheel(wheel, int(size), name, version, sha256)


def _fits(wheel: Wheel, python: str) -> bool:
    if not wheel.sha256:
        return True
    tag, abi = wheel.file.split("-")[-3:-1]
    return "py3" in tag or abi == "abi3" or tag == f"cp{python.replace('.', '')}"
