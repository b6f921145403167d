"""The environments in the engine's folder: those that do not count are removed, and the one that does is copied.

An update works on the copy, so that the engine works until the copy takes its place, whatever ends it. The installation
runs this file with the Python of the environment that counts, so that it imports nothing but the standard library:

    python environments.py FOLDER COUNTING [COPY]
"""

import os
import re
import shutil
import sys
from pathlib import Path

FIRST = "env"
NAME = re.compile(r"env(-\d+)?")


def found(folder: Path) -> list[Path]:
    """The environments in a folder; none where it is not there."""
    paths = folder.iterdir() if folder.is_dir() else ()
    return sorted(path for path in paths if NAME.fullmatch(path.name) and path.is_dir() and not path.is_symlink())


def unused(folder: Path) -> str:
    """A name that no environment has: what a killed update started may still write to another."""
    numbers = [int(path.name.partition("-")[2] or 1) for path in found(folder)]
    return f"{FIRST}-{max(numbers, default=1) + 1}"


def clear(folder: Path, counting: str) -> None:
    """Remove the others, as far as the system allows."""
    for path in found(folder):
        if path.name != counting:
            shutil.rmtree(path, ignore_errors=True)


def copy(source: Path, target: Path) -> None:
    """Copy an environment, by hard links where the disk has them: who updates it replaces files, and changes none."""
    shutil.copytree(source, target, symlinks=True, copy_function=_link)


def _link(source: str, target: str) -> None:
    try:
        Path(target).hardlink_to(source)
    except OSError:
        shutil.copy2(source, target)


if __name__ == "__main__":
    place = Path(("\\\\?\\" if os.name == "nt" else "") + sys.argv[1])  # paths of any length
    clear(place, sys.argv[2])
    for name in sys.argv[3:]:
        copy(place / sys.argv[2], place / name)
