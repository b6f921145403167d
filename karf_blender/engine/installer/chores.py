"""Work on many files of an installation, by a child process, so that Blender's window goes on. Standard library only.

`python chores.py VERB ...` calls the function `check`, `clear`, `remove` or `test` with its arguments.
"""

import base64
import csv
import hashlib
import importlib
import json
import os
import re
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

NAME = re.compile(r"env(-\d+)?")  # of environments: `env`, `env-2`


def command(verb: str, *arguments: str, python: str = sys.executable) -> tuple[str, ...]:
    """Return the command line of a verb, which usually Blender's own Python executes."""
    return (python, "-I", "-B", "-X", "utf8", __file__, verb, *arguments)


def environments(folder: Path) -> list[Path]:
    """Return the environments in a folder that may be missing."""
    paths = folder.iterdir() if folder.is_dir() else ()
    return sorted(path for path in paths if NAME.fullmatch(path.name) and path.is_dir() and not path.is_symlink())


def check(folder: Path, counting: str) -> None:
    """Delete other environments, and unpacked packages that are not what their RECORD says: uv fetches them again."""
    drop_environments(folder, counting)
    for archive in folder.glob("cache/archive-v*/*"):
        records = list(archive.glob("*.dist-info/RECORD"))
        if not records or not is_whole(archive, records[0]):
            shutil.rmtree(archive, ignore_errors=True)
    # uv does not check that what it has unpacked from a folder of wheels is still there
    for pointer in folder.glob("cache/wheels-v*/*/*/*/*.rev"):
        pointer.unlink()


def is_whole(folder: Path, record: Path) -> bool:
    """Tell whether all files of a package have the sizes and hashes of its RECORD."""
    with record.open(encoding="utf-8", newline="") as stream:
        for path, expected, size in csv.reader(stream):
            file = folder / path
            if path.endswith(".pyc"):
                continue
            if not file.is_file() or (size and file.stat().st_size != int(size)):
                return False
            kind, _, value = expected.partition("=")
            if kind and _hash(file, kind) != value:
                return False
    return True


def _hash(file: Path, kind: str) -> str:
    with file.open("rb") as stream:
        digest = hashlib.file_digest(stream, kind).digest()
    return base64.urlsafe_b64encode(digest).rstrip(b"=").decode("ascii")


def clear(folder: Path, counting: str) -> None:
    """Delete other environments, and cached packages without hard links; on disks that have none, all of them."""
    drop_environments(folder, counting)
    for archive in folder.glob("cache/archive-v*/*"):
        if not any(file.stat().st_nlink > 1 for file in archive.glob("*.dist-info/METADATA")):
            shutil.rmtree(archive, ignore_errors=True)


def drop_environments(folder: Path, counting: str) -> None:
    """Delete all environments but one, except where a job runs."""
    for path in environments(folder):
        if path.name != counting and not _is_used(path):
            shutil.rmtree(path, ignore_errors=True)


def _is_used(path: Path) -> bool:
    if os.name == "nt":  # where no folder of open files can be renamed
        try:
            path.rename(path.with_name("env-0")).rename(path)
        except OSError:
            return True
        return False
    lines = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):  # ended meanwhile
            lines.append(file.read_bytes())
    if not lines:  # not Linux
        lines.append(subprocess.run(["ps", "-axww", "-o", "command="], capture_output=True).stdout)
    return os.fsencode(path / "bin") in b"\n".join(lines)


def remove(folder: Path, ignore_errors: bool = False) -> None:
    """Delete environments, uv and what was fetched."""
    for path in (*environments(folder), folder / "cache", folder / "uv"):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=ignore_errors)


def test(*modules: str) -> None:
    """Load packages, let torch compute, and print a line of JSON; one that does not load ends this with its error."""
    torch = {name: importlib.import_module(name) for name in modules}["torch"]
    if float(torch.ones(3).sum()) != 3.0:
        sys.exit("torch does not add up")
    build = "cuda" if torch.version.cuda else "rocm" if torch.version.hip else "cpu"
    has_mps = torch.backends.mps.is_available()
    device = torch.cuda.get_device_name() if torch.cuda.is_available() else "Apple GPU" if has_mps else "CPU"
    print(json.dumps({"torch": torch.__version__, "build": build, "device": device}), flush=True)


if __name__ == "__main__":
    verb, *arguments = sys.argv[1:]
    if verb == "test":
        test(*arguments)
    else:
        place = Path(("\\\\?\\" if os.name == "nt" else "") + arguments[0])  # paths of any length
        if verb == "remove":
            remove(place, ignore_errors=True)
        else:
            {"check": check, "clear": clear}[verb](place, arguments[1])
