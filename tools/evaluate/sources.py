"""The source modules that a measurement depends on, and whether they have changed since (standard library only).

A module counts when one of its functions ran, or when one that ran takes a constant, a dataclass or a compiled kernel
from it. Its
digest is that of its syntax tree without docstrings, so that comments, formatting and documentation change nothing.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import FrameType

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("karf_engine", "tools")
IMPORTING = "<frozen importlib._bootstrap>"
# these move files, report progress, read options: no figure depends on them
NEUTRAL = (
    "karf_engine/api.py",
    "karf_engine/cli/",
    "karf_engine/commands/job.py",
    "karf_engine/compute/progress.py",
    "karf_engine/errors.py",
    "karf_engine/io/arguments.py",
    "karf_engine/io/files.py",
    "karf_engine/io/locks.py",
    "karf_engine/io/names.py",
    "karf_engine/io/options.py",
    "karf_engine/io/plugins.py",
    "karf_engine/project/contents.py",
    "karf_engine/project/folder.py",
    "karf_engine/project/jobs.py",
    "karf_engine/project/locking.py",
    "karf_engine/project/state.py",
    "karf_engine/project/volumes.py",
    "karf_engine/version.py",
    "karf_engine/worker/",
    "tools/dev.py",
    "tools/evaluate/__main__.py",
    "tools/evaluate/jobs.py",
    "tools/evaluate/pages.py",
    "tools/evaluate/sources.py",
    "tools/evaluate/store.py",
    "tools/evaluate/table.py",
)


class Trace:
    """The files of all Python functions that were called while it is on, in every thread."""

    def __init__(self) -> None:
        self.files: set[str] = set()

    def _called(self, frame: FrameType, event: str, _: object) -> None:
        if event != "call" or not frame.f_code.co_flags & inspect.CO_OPTIMIZED:  # the body of a module or a class
            return
        file = frame.f_code.co_filename
        if file not in self.files and not _is_importing(frame):
            self.files.add(file)

    def start(self) -> None:
        """Trace from here on."""
        threading.setprofile(self._called)
        sys.setprofile(self._called)

    def stop(self) -> None:
        """Trace no longer."""
        sys.setprofile(None)
        threading.setprofile(None)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Do not trace within: for what is timed."""
        self.stop()
        try:
            yield
        finally:
            self.start()

    def modules(self) -> set[str]:
        """Return the traced modules of this repository, and those whose constants or kernels they take."""
        return with_constants(name for file in self.files if (name := module_of(file)))


def _is_importing(frame: FrameType | None) -> bool:
    """Test whether a function was called while a module was imported: what decorators and registries do counts as nothing."""
    while frame and frame.f_code.co_filename != IMPORTING:
        frame = frame.f_back
    return frame is not None


def module_of(file: str) -> str | None:
    """Return a file's path below the repository, such as `tools/dev.py`; None if it does not count."""
    path = Path(file)
    if not path.is_relative_to(ROOT):
        return None
    name = path.relative_to(ROOT).as_posix()
    return name if name.startswith(PACKAGES) and not name.startswith(NEUTRAL) and path.is_file() else None


def with_constants(modules: Iterator[str]) -> set[str]:
    """Return the modules and those that they take constants or kernels from, and so on."""
    found: set[str] = set()
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += constants_of(name)
    return found


@cache
def constants_of(module: str) -> tuple[str, ...]:
    """Return the modules of this repository from which a module imports a constant, a dataclass or a compiled kernel."""
    found = []
    for node in ast.walk(ast.parse((ROOT / module).read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            package = _package_of(module, node)
            inner = [_file_of(package / alias.name) for alias in node.names]
            found += [name for name in inner if name]
            source = _file_of(package)
            if source and any(alias.name in _constants_in(source) for alias in node.names):
                found.append(source)
    return tuple(name for name in found if not name.startswith(NEUTRAL))


def _package_of(module: str, node: ast.ImportFrom) -> Path:
    """The path that an import names, without its suffix."""
    below = Path(*(node.module or "").split(".")) if node.module else Path()
    return Path(module).parents[node.level - 1] / below if node.level else below


def _file_of(path: Path) -> str | None:
    """A module's file of that name in this repository."""
    for name in (path.with_suffix(".py").as_posix(), (path / "__init__.py").as_posix()):
        if name.startswith(PACKAGES) and (ROOT / name).is_file():
            return name
    return None


@cache
def _constants_in(module: str) -> frozenset[str]:
    """Names of the constants, dataclasses and compiled kernels that a module defines."""
    names = set()
    for node in ast.parse((ROOT / module).read_text(encoding="utf-8")).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            decorators = " ".join(map(ast.unparse, node.decorator_list))
            if "kernel" in decorators or "dataclass" in decorators:
                names.add(node.name)
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            bound = (each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name))
            names |= {name for name in bound if name.isupper()}
    return frozenset(names)


def digests(modules: set[str], root: Path = ROOT) -> dict[str, str]:
    """Return the digest of each module, by name."""
    return {name: digest(root / name) for name in sorted(modules)}


def digest(file: Path) -> str:
    """Return eight digits that change with a module's code, not with its comments, docstrings or formatting."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)) and ast.get_docstring(
            node
        ):
            node.body = node.body[1:]
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()[:8]


def changed(recorded: Mapping[str, str], root: Path = ROOT) -> list[str]:
    """Return the recorded modules that are gone or whose digest differs now."""
    return [name for name, value in recorded.items() if not (root / name).is_file() or digest(root / name) != value]
