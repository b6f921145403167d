"""Check that no symbolic link inside an untrusted folder leads out of it.

Archives and version control keep symbolic links, so any file or folder of a downloaded project may be one. The root
folder itself may be reached through a link.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from ..errors import DataError

JUNCTION = 0xA0000003  # Windows: IO_REPARSE_TAG_MOUNT_POINT


def checked_path(root: Path, *names: str) -> Path:
    """Join path parts to a folder; the path need not exist. Raises DataError if a link leads out of it or is circular."""
    path = root
    for name in names:
        path = path / name
        if is_link(path):
            _check_target(root, path)
    return path


def check_tree(root: Path, folder: Path) -> Path:
    """Check every link in a folder below `root`, at any depth, and return the folder. Raises DataError as `checked_path`.

    Hidden dangling links, such as those of programs that synchronize folders, are ignored.
    """
    checked_path(root, *folder.relative_to(root).parts)
    for place, folders, files in os.walk(folder):  # follows no links
        for path in (Path(place, name) for name in (*folders, *files)):
            if is_link(path) and (path.exists() or not path.name.startswith(".")):
                _check_target(root, path)
    return folder


def is_link(path: Path) -> bool:
    """Test for a symbolic link or a Windows junction; False if the path does not exist."""
    try:
        status = path.lstat()
    except (OSError, ValueError):  # missing, or not a valid name
        return False
    return stat.S_ISLNK(status.st_mode) or getattr(status, "st_reparse_tag", 0) == JUNCTION


def leads_out(root: Path, path: Path) -> bool:
    """Test whether a path, with links resolved, is outside a folder or circular."""
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
