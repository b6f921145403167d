"""The plan of an installation: how much it fetches, from where, where to, and its commands. No bpy."""

import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from ...engine_api import BadRequest, DataError
from . import chores, computer, home, locks
from .computer import Machine, Source, Starter, shell_line
from .locks import Lock, Wheel

EXTRAS = {"photos": "pycolmap"}  # optional packages by the names of their lock files
# bytes on disk for each fetched byte, with compiled Python files; measured for cpu and cuda on Linux
UNPACKED = {"cpu": 4.0, "cuda": 1.9, "rocm": 3.5, "mps": 3.5}
LONGEST_PATH = 259  # letters of a path on Windows, unless it is set up otherwise
LONGEST_INSIDE = 153  # letters of the longest path below the folder that Python opens; uv itself knows no limit
MOST_NAMED = 6  # files named in a sentence


@dataclass(frozen=True)
class Choices:
    folder: Path
    build: str = "auto"  # one of `locks.BUILDS`
    extras: tuple[str, ...] = ()  # of EXTRAS
    wheels: Path | None = None  # a folder of wheels, instead of the network
    starter: str = ""  # a Python, or uv, that makes the environment; empty: the first found


class Step(NamedTuple):
    """A command of an installation."""

    title: str
    command: tuple[str, ...]
    source: str = ""  # where it fetches from
    wheels: tuple[Wheel, ...] = ()  # files to install
    is_needed: bool = True  # without it all fails

    @property
    def bytes(self) -> int:
        return sum(wheel.size for wheel in self.wheels)


@dataclass(frozen=True)
class Plan:
    """An installation to come, told by `sentences` and `commands`."""

    choices: Choices
    machine: Machine
    starter: Starter
    source: Source
    lock: Lock
    environment: Path
    tools: tuple[Wheel, ...]  # uv, where it has to be fetched
    free_bytes: int

    @property
    def folder(self) -> Path:
        return self.choices.folder

    @property
    def backend(self) -> str:
        """The build as uv calls it; empty where the usual index has it, with a hash."""
        if self.lock.torch.sha256 and "+" not in self.lock.torch.version:
            return ""
        return "cpu" if self.lock.build == "cpu" else "auto"  # by the versions that the driver allows

    @property
    def unchecked(self) -> str:  # the package without a known hash
        return "" if self.lock.torch.sha256 else f"torch {self.lock.torch.version} for {self.lock.build}"

    @property
    def sources(self) -> str:
        is_more = self.backend and not self.choices.wheels
        return self.source.sentence + (" and torch's own index, which uv knows" if is_more else "")

    @property
    def download_bytes(self) -> int:
        return self.lock.bytes + sum(wheel.size for wheel in self.tools)

    @property
    def disk_bytes(self) -> int:  # of the environment, estimated
        return round(self.download_bytes * UNPACKED[self.lock.build])

    @property
    def sentences(self) -> tuple[str, ...]:
        checked = [wheel for wheel in self.lock.wheels + self.tools if wheel.sha256]
        more, about = (f" and {self.unchecked}", "about ") if self.unchecked else ("", "")
        begun = " What is there already and whole is not fetched again." if home.is_ours(self.folder) else ""
        lines = [
            f"{self.machine.device_sentence} Build of torch: {self.lock.build}.",
            f"{len(checked)} checked files{more}, {about}{size_text(self.download_bytes)}.{begun}",
            f"From {self.sources}.",
            f"To {self.folder}, about {size_text(self.disk_bytes)}; {size_text(self.free_bytes)} are free.",
            f"The environment is {self.starter.sentence}. Blender's own Python stays as it is.",
        ]
        if self.unchecked:
            lines.append(f"KaRF has no hash of {self.unchecked}: it is checked by its version only.")
        if self.machine.platform.startswith("windows") and len(str(self.folder)) + LONGEST_INSIDE > LONGEST_PATH:
            lines.append(
                "Paths below this folder get longer than Windows allows by default: choose a folder such as "
                "C:\\karf, or switch long paths on in Windows."
            )
        return tuple(lines)

    @property
    def uv(self) -> str:
        return self.starter.uv or str(home.program_of(self.folder / "uv", "uv"))

    @property
    def cache(self) -> Path:
        return self.folder / "cache"

    def steps(self) -> tuple[Step, ...]:
        """Return the commands that make the environment."""
        offline = ("--no-index", "--find-links", str(self.choices.wheels)) if self.choices.wheels else ()
        found, uv_folder = [], self.folder / "uv"
        if self.tools:
            pip = (str(home.python_of(uv_folder)), "-I", "-m", "pip", "install", "--require-hashes", "--no-deps")
            pip += ("--only-binary", ":all:", "--disable-pip-version-check", "--no-input", "--progress-bar", "off")
            pip += ("--retries", "2", *offline, "--requirement", str(locks.FOLDER / "uv.txt"))
            make = (self.starter.python, "-I", "-m", "venv", "--clear", str(uv_folder))
            found += [Step("Preparing uv", make), Step("Fetching uv", pip, self.source.sentence, self.tools)]
        python = str(home.python_of(self.environment))
        make = (self.uv, "venv", "--clear", "--python", self.starter.python or self.starter.version)
        found.append(Step("Making the environment", (*make, str(self.environment))))
        fill = (self.uv, "pip", "install", "--python", python)
        fill += ("--cache-dir", str(self.cache), "--link-mode", "hardlink")
        # the engine's jobs write no compiled files: without them each would read all sources anew
        fill += ("--only-binary", ":all:", "--compile-bytecode", *offline)
        # uv checks the hashes that there are also without --require-hashes
        fill += () if self.unchecked else ("--no-deps", "--require-hashes")
        fill += ("--torch-backend", self.backend) if self.backend and not offline else ()
        fill += tuple(part for file in self.lock.files for part in ("--requirement", str(file)))
        return (*found, Step("Installing packages", fill, self.sources, self.lock.wheels))

    def commands(self, shell: str = "") -> str:
        """Return the commands for `posix`, `powershell` or `cmd`; default: this system's usual shell."""
        shell = shell or ("powershell" if self.machine.platform.startswith("windows") else "posix")
        return "\n".join(shell_line(step.command, shell) for step in self.steps())


def make(
    choices: Choices,
    own_python: str,
    is_online: bool,
    variables: Mapping[str, str] = os.environ,
    here: Machine | None = None,
) -> Plan:
    """Plan an installation: takes a second, changes nothing.

    Raises KarfError where it cannot be done: no network allowed, no starter, no such build, wheels missing, no space.
    """
    here, folder = here or computer.detect_machine(), choices.folder
    if not folder.is_absolute():
        raise BadRequest(f"The folder {folder} is not given by its whole path.", "Choose it anew.")
    home.check_free(folder)
    if not (is_online or choices.wheels):
        raise BadRequest(
            "Blender may not use the network.",
            "Switch on Preferences > System > Network > Allow Online Access, or choose a folder of wheels.",
        )
    if unknown := set(choices.extras) - EXTRAS.keys():
        raise BadRequest(f"{', '.join(sorted(unknown))} is not an extra of the engine.", "Use photos, or none.")
    build = computer.build_for(choices.build, here)
    locks.read(here.platform, build, locks.PYTHONS[0], choices.extras)  # raises where there is none
    starter = computer.find_starter(choices.starter, own_python, variables)
    lock = locks.read(here.platform, build, starter.version, choices.extras)
    uv = locks.read_uv(here.platform)
    tools = () if starter.uv or _has_uv(folder, uv) else (uv,)
    if choices.wheels:
        if choices.build == "auto" and not lock.torch.find(choices.wheels):
            others = [locks.read(here.platform, each, starter.version, choices.extras) for each in here.builds]
            lock = next((each for each in others if each.torch.find(choices.wheels)), lock)
        _check_wheels(choices.wheels, lock.wheels + tools, starter.version)
    free = shutil.disk_usage(next(path for path in (folder, *folder.parents) if path.is_dir())).free
    environment = folder / home.new_environment(folder)
    source = computer.find_source(variables, choices.wheels)
    plan = Plan(choices, here, starter, source, lock, environment, tools, free)
    # only where it is needed: counting what is there already takes time
    needed = plan.disk_bytes
    if free < needed:
        needed -= max(home.measure(plan.cache), default=0)
    if free < needed:
        raise DataError(
            f"The disk of {folder} has {size_text(free)} free; the engine needs about {size_text(needed)}.",
            "Free some space, or choose a folder on another disk.",
        )
    return plan


def _has_uv(folder: Path, uv: Wheel) -> bool:
    """Tell whether the tested uv was fetched, and is whole."""
    below = "Lib" if os.name == "nt" else "lib/*"
    records = (folder / "uv").glob(f"{below}/site-packages/uv-{uv.version}.dist-info/RECORD")
    return any(chores.is_whole(record.parents[1], record) for record in records)


def _check_wheels(folder: Path, wheels: Sequence[Wheel], python: str) -> None:
    """Raise DataError that names files that are missing, or not whole; uv checks hashes."""
    found = {wheel: wheel.find(folder, python) for wheel in wheels}
    missing = [wheel.file for wheel, path in found.items() if path is None]
    if missing:
        more = f" and {len(missing) - MOST_NAMED} more" if len(missing) > MOST_NAMED else ""
        raise DataError(
            f"{folder} lacks {len(missing)} of {len(wheels)} files: {', '.join(missing[:MOST_NAMED])}{more}.",
            "Fetch them on another computer: steps.engine_files() gives their list and the command.",
        )
    for wheel, path in found.items():
        size = path.stat().st_size
        if wheel.sha256 and size != wheel.size:
            raise DataError(f"{path} has {size:,} bytes in place of {wheel.size:,}.", "Fetch this file again.")


def fetching(lock: Lock, python: str, platform: str, shell: str) -> tuple[str, str]:
    """Return the text of `karf-wheels.txt`, and the command that fetches its files into the folder `wheels`."""
    wheels = [wheel for wheel in (*lock.wheels, locks.read_uv(platform)) if wheel.sha256]
    listing = "".join(f"{wheel.requirement}  # {wheel.file}, {wheel.size:,} bytes\n" for wheel in wheels)
    tags = [wheel.file[:-4].split("-")[-2:] for wheel in wheels]
    systems = sorted({system for _, each in tags for system in each.split(".")} - {"any"})
    command = ["python", "-m", "pip", "download", "--no-deps", "--only-binary", ":all:", "--require-hashes"]
    command += ["--implementation", "cp", "--python-version", python]
    command += [part for abi in sorted({abi for abi, _ in tags}) for part in ("--abi", abi)]
    command += [part for system in systems for part in ("--platform", system)]
    return listing, shell_line([*command, "--dest", "wheels", "--requirement", "karf-wheels.txt"], shell)


def size_text(count: int) -> str:
    """Return bytes for people, such as `2.8 GB`."""
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.{0 if count >= 1e7 else 1}f} MB"
