"""The extension's zip, without Blender: which files belong to it, and the same bytes from the same files.

Names are sorted, times and permissions are fixed, and nothing is compressed: what deflate makes of a file differs
between zlib and its successors, and so would the checksum between two computers.
"""

from __future__ import annotations

import os
import sys
import zipfile
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath

TIME = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip can tell
UNIX = 3  # the system that permissions are stored for
PERMISSIONS = 0o100644  # a plain file that all may read


def packed_files(root: Path, patterns: Sequence[str]) -> list[str]:
    """The files of a folder that no pattern leaves out, as sorted paths with slashes.

    Args:
        root: The folder.
        patterns: As in `paths_exclude_pattern` of an extension's manifest, which are those of a .gitignore. A slash at
            the end: folders only; one at the start: the whole path from `root`. Else a pattern is that of a name.

    Raises:
        SystemExit: A pattern is of a kind that is not known here.
    """
    for pattern in patterns:
        _check(pattern)
    return sorted(_walk(root, PurePosixPath(), patterns))


def write_zip(path: Path, root: Path, names: Sequence[str]) -> None:
    """Write files of a folder into a zip whose bytes depend on their names and contents alone."""
    temporary = path.with_name(f".{path.name}")
    with zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as package:
        for name in names:
            entry = zipfile.ZipInfo(name, TIME)
            entry.create_system = UNIX
            entry.external_attr = PERMISSIONS << 16
            package.writestr(entry, (root / name).read_bytes())
    temporary.replace(path)


def _walk(root: Path, folder: PurePosixPath, patterns: Sequence[str]) -> Iterator[str]:
    with os.scandir(root / folder) as entries:
        for entry in entries:
            path = folder / entry.name
            if any(_matches(path, entry.is_dir(), pattern) for pattern in patterns):
                continue
            if entry.is_dir():
                yield from _walk(root, path, patterns)
            else:
                yield str(path)


def _matches(path: PurePosixPath, is_folder: bool, pattern: str) -> bool:
    if pattern.endswith("/") and not is_folder:
        return False
    if not pattern.startswith("/"):
        return fnmatchcase(path.name, pattern.strip("/"))
    names = pattern.strip("/").split("/")
    return len(names) == len(path.parts) and all(map(fnmatchcase, path.parts, names))


def _check(pattern: str) -> None:
    path = pattern.removeprefix("/").removesuffix("/")
    names = path.split("/") if pattern.startswith("/") else [path]
    if not all(names) or "/" in names[-1] or path[0] in "!\\" or "**" in path:
        sys.exit(
            f"error: the manifest leaves out {pattern!r}, a pattern that the build does not know. "
            "Use a name with * and ?, or with a slash before it a path from the top, and a slash behind it for folders only."
        )
