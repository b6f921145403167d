"""Check that a package's imports only run from higher floors to lower ones, without circles.

A room is a folder or file directly in the package's folder; a table lists the rooms of each floor, lowest first.
"""

import ast
from collections.abc import Collection, Iterator, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from pathlib import Path


def violations(package: Path, floors: Sequence[Sequence[str]]) -> list[str]:
    """A sentence for each import that runs up or sideways, each room missing on either side, and a circle."""
    files = modules(package)
    imports = {name: set(_imported(name, path, package.name, files)) for name, path in files.items()}
    floor_of = {room: floor for floor, rooms in enumerate(floors) for room in rooms}
    rooms = {name.partition(".")[0] for name in files}
    found = [f"The room {room} is on no floor of the table." for room in sorted(rooms - set(floor_of))]
    found += [f"The room {room} of the table is not in the package." for room in sorted(set(floor_of) - rooms)]
    for name, targets in imports.items():
        found += [sentence for target in sorted(targets) if (sentence := _misplaced(name, target, floor_of))]
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:  # its list has each module after the one that it imports
        found.append(f"A circle: {' imports '.join(error.args[1][::-1])}.")
    return found


def modules(package: Path) -> dict[str, Path]:
    """All files of a package by dotted name within it: `rig.lens`; a folder's own file is `rig.__init__`."""
    paths = sorted(package.rglob("*.py"))
    return {".".join(path.relative_to(package).with_suffix("").parts): path for path in paths}


def _misplaced(name: str, target: str, floor_of: Mapping[str, int]) -> str:
    """Why a module may not import another; empty if it may, or if the table lacks a room."""
    room, other = (module.partition(".")[0] for module in (name, target))
    if room == other or not {room, other} <= set(floor_of) or floor_of[other] < floor_of[room]:
        return ""
    where = "the same floor" if floor_of[other] == floor_of[room] else "a higher floor"
    return f"{name} imports {target}, but {other} is on {where}."


def _imported(name: str, path: Path, package: str, files: Collection[str]) -> Iterator[str]:
    """The files of the package that one of them imports, relatively or by the package's name."""
    folder = [package, *name.split(".")[:-1]]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for parts in _dotted(node, folder):
            target = _file_of(parts[1:], files) if parts[0] == package else ""
            if target and target != name:
                yield target


def _dotted(node: ast.AST, folder: Sequence[str]) -> list[list[str]]:
    """The dotted names that a node imports, relative ones completed, without those outside the package."""
    if isinstance(node, ast.Import):
        return [alias.name.split(".") for alias in node.names]
    if not isinstance(node, ast.ImportFrom) or node.level > len(folder):
        return []
    start = folder[: len(folder) - node.level + 1] if node.level else []
    return [[*start, *(node.module or "").split("."), alias.name] for alias in node.names]


def _file_of(parts: Sequence[str], files: Collection[str]) -> str:
    """The file that dotted parts lead to (the last may be a name in the file); empty if there is none."""
    parts = [part for part in parts if part]
    for end in (len(parts), len(parts) - 1):
        for name in (".".join(parts[:end]), ".".join([*parts[:end], "__init__"])):
            if name in files:
                return name
    return ""
