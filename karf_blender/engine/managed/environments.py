"""The environments in the engine's folder: those that do not count are removed, and the one that does is copied.

An update works on the copy, so that the engine works until the copy takes its place, whatever ends it. The installation
runs this file with the Python of the one that counts, so that it imports nothing but the standard library:

    python environments.py FOLDER COUNTING [COPY]
"""

import os
import re
import shutil
import subprocess
import sys
from contextlib import suppress
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
    """Remove the others, but for those in which a program runs, such as a job of the engine."""
    for path in found(folder):
        if path.name != counting and not _is_used(path):
            shutil.rmtree(path, ignore_errors=True)


def _is_used(path: Path) -> bool:
    if os.name == "nt":  # where no folder of open files can be renamed
        try:
            path.rename(path.with_name(f"{FIRST}-0")).rename(path)
        except OSError:
            return True
        return False
    return os.fsencode(path / "bin") in _command_lines()


def _command_lines() -> bytes:
    """Those of all processes, where the system tells them."""
    lines = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):  # ended meanwhile
            lines.append(file.read_bytes())
    if not lines:  # not Linux
        lines.append(subprocess.run(["ps", "-axww", "-o", "command="], capture_output=True).stdout)
    return b"\n".join(lines)


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
