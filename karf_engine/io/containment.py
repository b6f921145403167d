"""Paths inside a folder that a stranger may have filled: no link in it leads out of it.

Archives and version control keep symbolic links, so a project from elsewhere may have one in place of any file or folder.
Every path is checked before it is used. The folder itself may be reached through a link: the user chose it.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from ..errors import DataError

JUNCTION = 0xA0000003  # Windows: IO_REPARSE_TAG_MOUNT_POINT


def inside(root: Path, *names: str) -> Path:
    """Return the path of these names below a folder, once no link on the way leads out of the folder.

    Args:
        root: The folder, which need not exist.
        *names: Of folders and at last a file or folder, which need not exist.

    Raises:
        DataError: A link leads out of the folder, or round in a circle; names the link and where it leads.
    """
    path = root
    for name in names:
        path = path / name
        if is_link(path):
            _check_target(root, path)
    return path


def check_tree(root: Path, folder: Path) -> Path:
    """Return a folder below `root`, once no link in it, at any depth, leads out of `root`.

    Hidden links to nothing, such as those of programs that synchronize folders, are ignored.

    Raises:
        DataError: As `inside`.
    """
    inside(root, *folder.relative_to(root).parts)
    for place, folders, files in os.walk(folder):  # follows no links
        for path in (Path(place, name) for name in (*folders, *files)):
            if is_link(path) and (path.exists() or not path.name.startswith(".")):
                _check_target(root, path)
    return folder


def is_link(path: Path) -> bool:
    """Whether this is a symbolic link, or a junction of Windows; what does not exist is not one."""
    try:
        found = path.lstat()
    except (OSError, ValueError):  # not there, or a name that no disk can hold
        return False
    return stat.S_ISLNK(found.st_mode) or getattr(found, "st_reparse_tag", 0) == JUNCTION


def leads_out(root: Path, path: Path) -> bool:
    """Whether a path, its links followed, lies outside a folder, or its links lead round in a circle."""
    try:
        target = path.resolve()
        return not target.is_relative_to(root.resolve()) or is_link(target)
    except (OSError, RuntimeError):  # a circle
        return True


def _check_target(root: Path, link: Path) -> None:
    if leads_out(root, link):
        raise DataError(
            "{link} is a link to {target}, outside of {root}.",
            "Remove the link, or put the file or folder itself there.",
            link=link,
            target=link.readlink(),
            root=root,
        )
