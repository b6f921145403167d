"""The folder of the engine's environment: its state, its removal. No bpy.

The environment counts that `installed.json` names, which is written last. `karf-engine.json` says that the folder is
KaRF's: nothing else is ever deleted.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...engine_api import BadRequest, DataError, KarfError, read_json, write_json
from ..failures import disk_errors
from . import chores, locks

SCHEMA = "karf-managed/1"
MARK, INSTALLED, LOG = "karf-engine.json", "installed.json", "install.log"
FORMER = ("packages.txt", "uv.txt")  # lists that earlier versions of the extension wrote
NONE, UNFINISHED, BROKEN, OUTDATED, READY = "none", "unfinished", "broken", "outdated", "ready"


@dataclass(frozen=True)
class Status:
    """The environment in a folder: the one that counts, or an unfinished one."""

    state: str
    sentence: str
    build: str = "auto"
    extras: tuple[str, ...] = ()
    python: str = ""
    torch: str = ""
    environment: str = "env"

    @property
    def is_usable(self) -> bool:
        return self.state in (READY, OUTDATED)


def status(folder: Path) -> Status:
    """Read the state of a folder. Never raises."""
    try:
        mark = _read(folder / MARK)
        known = _chosen(mark)
    except (KarfError, LookupError, TypeError):
        return Status(NONE, "No engine is installed.")
    try:
        installed = _read(folder / INSTALLED)
        mark |= installed.get("chosen", {})
        name, torch, digest = installed.get("environment", "env"), str(installed["torch"]), installed["digest"]
        if not chores.NAME.fullmatch(name):
            raise LookupError(name)
        known = {**_chosen(mark), "torch": torch, "environment": name}
    except (KarfError, LookupError, TypeError):
        return Status(UNFINISHED, "The installation is not finished; what was fetched is kept.", **known)
    if not python_of(folder / name).is_file():
        gone = "The environment's Python is gone, as after a move or update of Blender; Repair makes it anew."
        return Status(BROKEN, gone, **known)
    try:
        today = locks.read(mark["platform"], known["build"], known["python"], known["extras"]).digest
    except (KarfError, LookupError):
        today = ""
    if digest != today:
        return Status(OUTDATED, "This version of KaRF has been tested with other packages; Update gets them.", **known)
    return Status(READY, f"Installed: Python {mark['python']}, torch {torch}.", **known)


def python_in(folder: Path) -> Path | None:
    """Return the Python of the environment in a folder, where it is finished and there."""
    found = status(folder)
    return python_of(folder / found.environment) if found.is_usable else None


def python_of(environment: Path) -> Path:
    return program_of(environment, "python")


def program_of(environment: Path, name: str) -> Path:
    return environment / "Scripts" / f"{name}.exe" if os.name == "nt" else environment / "bin" / name


def new_environment(folder: Path) -> str:
    """Return a name that no environment has: what a killed update has started may still write to another."""
    numbers = [int(path.name.partition("-")[2] or 1) for path in chores.environments(folder)]
    return f"env-{max(numbers) + 1}" if numbers else "env"


def claim(folder: Path, chosen: dict[str, Any]) -> None:
    """Make the folder KaRF's, and note what is to be in it; raises DataError as `check_free`."""
    with disk_errors():
        check_free(folder)
        folder.mkdir(parents=True, exist_ok=True)
        write_json(folder / MARK, {"schema": SCHEMA, **chosen})


def check_free(folder: Path) -> None:
    """Raise DataError unless a folder is KaRF's, empty or not there yet."""
    for above in (folder, *folder.parents):
        if above.exists() and not above.is_dir():
            raise DataError(f"{above} is a file; the engine needs a folder.", "Choose another folder.")
    if folder.is_dir() and any(folder.iterdir()) and not is_ours(folder):
        raise DataError(
            f"{folder} holds files that are not of KaRF's engine.", "Choose an empty folder, or one that is not there."
        )


def check_ours(folder: Path) -> None:
    if not is_ours(folder):
        raise BadRequest(f"{folder} was not made by KaRF; nothing was deleted.", "Delete it by hand if you mean it.")


def is_ours(folder: Path) -> bool:
    try:
        return bool(_read(folder / MARK))
    except (KarfError, LookupError, TypeError):
        return False


def remove(folder: Path) -> None:
    """Delete the environments and all that belongs to them; this may take a minute.

    Raises BadRequest where the folder is not KaRF's, DataError where a file cannot be deleted.
    """
    check_ours(folder)
    with disk_errors():
        (folder / INSTALLED).unlink(missing_ok=True)  # from here on nobody starts it
        # on Windows so written, paths may have any length
        chores.remove(Path(f"\\\\?\\{folder}") if os.name == "nt" else folder)
        for name in (LOG, *FORMER, MARK):
            (folder / name).unlink(missing_ok=True)
        if not any(folder.iterdir()):
            folder.rmdir()


def measure(folder: Path) -> Iterator[int]:
    """Yield the bytes counted so far after each subfolder; files under two names count once."""
    seen: set[tuple[int, int]] = set()
    total = 0
    for root, _, names in os.walk(folder):
        for name in names:
            try:
                found = os.lstat(Path(root) / name)
            except OSError:
                continue
            if (found.st_dev, found.st_ino) not in seen:
                seen.add((found.st_dev, found.st_ino))
                total += found.st_size
        yield total


def _read(path: Path) -> dict[str, Any]:
    content = read_json(path, "the engine's mark")
    if content["schema"] != SCHEMA:
        raise DataError(f"{path} is of another version of KaRF.", "Remove the engine and install it anew.")
    return content


def _chosen(mark: dict[str, Any]) -> dict[str, Any]:
    # earlier versions of the extension had numba as an extra, `fast`
    extras = tuple(name for name in mark["extras"] if name != "fast")
    return {"build": mark["build"], "extras": extras, "python": mark["python"]}
