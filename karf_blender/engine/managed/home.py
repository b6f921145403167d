"""The folder of the managed environment: what lies in it, what state it is in, what may be deleted. No bpy.

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
from . import environments, recipes

SCHEMA = "karf-managed/1"
LISTS = ("packages", "uv")  # names of the requirements files
NONE, UNFINISHED, BROKEN, OUTDATED, READY = "none", "unfinished", "broken", "outdated", "ready"


@dataclass(frozen=True)
class Home:
    """A folder that environments are made in, and the name of one of them."""

    folder: Path
    name: str = environments.FIRST

    @property
    def mark(self) -> Path:
        return self.folder / "karf-engine.json"

    @property
    def installed(self) -> Path:
        return self.folder / "installed.json"

    @property
    def environment(self) -> Path:
        return self.folder / self.name

    @property
    def cache(self) -> Path:
        return self.folder / "cache"

    @property
    def log(self) -> Path:
        return self.folder / "install.log"

    def requirements(self, name: str) -> Path:
        """One of the lists of files that pip and uv are given."""
        return self.folder / f"{name}.txt"

    def program(self, name: str) -> Path:
        """A program of the environment."""
        if os.name == "nt":
            return self.environment / "Scripts" / f"{name}.exe"
        return self.environment / "bin" / name

    @property
    def python(self) -> Path:
        return self.program("python")

    def has_package(self, name: str) -> bool:
        """Whether a package (`*`: any) was put into the environment."""
        below = "Lib" if os.name == "nt" else "lib/*"
        return any(self.environment.glob(f"{below}/site-packages/{name}-*.dist-info"))


@dataclass(frozen=True)
class Status:
    """What is in a folder.

    state: `none`, `unfinished`, `broken`, `outdated` or `ready`. sentence: the same for people. build, extras, python
    and torch: of the environment that counts, or of the one that was begun. environment: its name.
    """

    state: str
    sentence: str
    build: str = "auto"
    extras: tuple[str, ...] = ()
    python: str = ""
    torch: str = ""
    environment: str = environments.FIRST

    @property
    def is_usable(self) -> bool:
        """Whether the engine can run in it."""
        return self.state in (READY, OUTDATED)


def status(folder: Path) -> Status:
    """What state a folder is in. Reads two small files; never raises."""
    try:
        mark = _read(Home(folder).mark)
        begun = _chosen(mark)
    except (KarfError, LookupError, TypeError):
        return Status(NONE, "No engine is installed.")
    home = counting(folder)
    try:
        installed = _read(Home(folder).installed) if home else {}
        mark = {**mark, **installed.get("chosen", {})}
        torch, digest = str(installed["torch"]), installed["digest"]
        known = {**_chosen(mark), "torch": torch, "environment": home.name}
    except (KarfError, LookupError, TypeError):
        return Status(UNFINISHED, "The installation is not finished; what was fetched is kept.", **begun)
    if not home.python.is_file():
        gone = "The environment's Python is gone, as after a move or update of Blender; Repair makes it anew."
        return Status(BROKEN, gone, **known)
    if digest != _digest_today(mark):
        return Status(OUTDATED, "This version of KaRF has been tested with other packages; Update gets them.", **known)
    return Status(READY, f"Installed: Python {mark['python']}, torch {torch}.", **known)


def python_in(folder: Path) -> Path | None:
    """The Python of the environment in a folder, where it is finished and there."""
    home = counting(folder)
    return home.python if home and home.python.is_file() else None


def counting(folder: Path) -> Home | None:
    """The environment that counts, there or not; None where none was finished."""
    try:
        name = _read(Home(folder).installed).get("environment", environments.FIRST)
        return Home(folder, name) if environments.NAME.fullmatch(name) else None
    except (KarfError, LookupError, TypeError):
        return None


def claim(home: Home, mark: dict[str, Any]) -> None:
    """Make the folder KaRF's, and note what is to be in it.

    Raises:
        DataError: It is a file, holds what others put there, or cannot be written.
    """
    with disk_errors():
        check_free(home.folder)
        home.folder.mkdir(parents=True, exist_ok=True)
        write_json(home.mark, {"schema": SCHEMA, **mark})


def check_free(folder: Path) -> None:
    """Raise DataError unless a folder is KaRF's, empty or not there yet."""
    for above in (folder, *folder.parents):
        if above.exists() and not above.is_dir():
            raise DataError(f"{above} is a file; the engine needs a folder.", "Choose another folder.")
    if folder.is_dir() and any(folder.iterdir()) and not _is_ours(folder):
        raise DataError(
            f"{folder} holds files that are not of KaRF's engine.", "Choose an empty folder, or one that is not there."
        )


def remove(folder: Path) -> None:
    """Delete the environments and all that belongs to them.

    Raises:
        BadRequest: The folder is not KaRF's.
        DataError: A file cannot be deleted.
    """
    for _ in removing(folder):
        pass


def removing(folder: Path) -> Iterator[None]:
    """The same bit by bit, folder after folder: tens of thousands of files take their time. Raises as `remove`."""
    home = Home(folder)
    if not _is_ours(folder):
        raise BadRequest(f"{folder} was not made by KaRF; nothing was deleted.", "Delete it by hand if you mean it.")
    with disk_errors():
        home.installed.unlink(missing_ok=True)  # from here on nobody starts it
        for path in (*environments.found(folder), home.cache):
            # on Windows so written, paths may have any length
            start = Path(f"\\\\?\\{path}") if os.name == "nt" else path
            for root, folders, names in os.walk(start, topdown=False):
                links = [name for name in folders if (Path(root) / name).is_symlink()]
                for name in (*names, *links):
                    (Path(root) / name).unlink()
                Path(root).rmdir()
                yield
        for path in (home.log, *map(home.requirements, LISTS), home.mark):
            path.unlink(missing_ok=True)
        if not any(folder.iterdir()):
            folder.rmdir()


def measure(folder: Path) -> Iterator[int]:
    """Bytes that a folder takes, counted so far, after each of its folders; files under two names count once."""
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
    return {"build": mark["build"], "extras": tuple(mark["extras"]), "python": mark["python"]}


def _is_ours(folder: Path) -> bool:
    try:
        return bool(_read(Home(folder).mark))
    except (KarfError, LookupError, TypeError):
        return False


def _digest_today(mark: dict[str, Any]) -> str:
    try:
        recipe = recipes.find(mark["platform"], mark["python"])
        return recipe.digest(mark["build"], mark["backend"], mark["extras"])
    except KarfError:
        return ""
