"""This computer: system and drivers, what can make an environment, where packages come from, shells. No bpy."""

import configparser
import os
import platform as system_of
import re
import shlex
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ...engine_api import BadRequest, MissingDependency
from .. import processes
from . import locks

SYSTEMS = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}
PROCESSORS = {"amd64": "x86_64", "aarch64": "arm64"}
NVIDIA = (  # files of its driver on Linux, under WSL, on Windows
    "proc/driver/nvidia/version",
    "dev/nvidiactl",
    "usr/lib/wsl/lib/libcuda.so.1",
    "Windows/System32/nvcuda.dll",
)
AMD = "dev/kfd"  # the compute driver; its folder below lists processors too, which have no graphics version
AMD_NODES = "sys/class/kfd/kfd/topology/nodes"
FOUND = {"cuda": "an NVIDIA driver", "rocm": "an AMD compute driver", "mps": "Apple silicon"}
FETCHED_PYTHON = "3.13"  # where uv has to find or fetch one
PLAIN = re.compile(r"[\w./:\\=+-]+")  # text that no Windows shell interprets
PROBE_SECONDS = 20.0
PROBE = (  # its version, its bits, and whether it can make environments
    "import struct, sys; from importlib.util import find_spec as has; "
    "print(*sys.version_info[:2], struct.calcsize('P') * 8, all(map(has, ('venv', 'ensurepip'))))"
)
UNIX_FOLDERS = ("/usr/local/bin", "/usr/bin", "/opt/homebrew/bin", "~/.local/bin")


# --- system and drivers -------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Machine:
    platform: str  # the system, as lock files call it
    devices: tuple[str, ...] = ()  # those of `cuda`, `rocm`, `mps` that have a driver

    @property
    def device_sentence(self) -> str:
        names = [FOUND[device] for device in self.devices]
        return f"Found {' and '.join(names)}." if names else "No graphics driver that torch could use was found."

    @property
    def builds(self) -> tuple[str, ...]:  # of torch
        return tuple(build for build in locks.BUILDS if locks.lock_file(self.platform, build).is_file())


def detect_machine(system: str = "", processor: str = "", root: Path | None = None) -> Machine:
    """Search for drivers' files; pass arguments to describe another computer."""
    system, processor = system or system_of.system(), (processor or system_of.machine()).lower()
    name, kind = SYSTEMS.get(system, system.lower()), PROCESSORS.get(processor, processor)
    root = root or Path(Path.cwd().anchor)
    if name == "macos":
        devices = ["mps"] if kind == "arm64" else []
    else:
        devices = ["cuda"] if any((root / path).exists() for path in NVIDIA) else []
        devices += ["rocm"] if name == "linux" and _has_amd(root) else []
    return Machine(f"{name}-{'aarch64' if (name, kind) == ('linux', 'arm64') else kind}", tuple(devices))


def _has_amd(root: Path) -> bool:
    nodes = (root / AMD_NODES).glob("*/properties") if (root / AMD).exists() else ()
    return any("gfx_target_version 0\n" not in path.read_text(encoding="ascii", errors="replace") for path in nodes)


def build_for(choice: str, machine: Machine) -> str:
    """Return the build of torch for a choice of `locks.BUILDS`: `auto` is that of the first device, else `cpu`."""
    if choice not in locks.BUILDS:
        raise BadRequest(f"{choice!r} is not a build of torch.", f"Choose one of {', '.join(locks.BUILDS)}.")
    if choice == "auto":
        return next((device for device in machine.devices if device in machine.builds), "cpu")
    if machine.builds and choice not in machine.builds:
        raise BadRequest(f"There is no {choice} build of torch for {machine.platform}.", "Choose auto.")
    return choice


# --- what makes an environment -----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Starter:
    """A Python (empty: uv finds or fetches one) and uv (empty: that Python fetches it), which make the environment."""

    python: str
    version: str
    uv: str = ""

    @property
    def sentence(self) -> str:
        if not self.uv:
            return f"made by {self.python} (Python {self.version})"
        return f"made by {self.uv} with {self.python or 'a Python that it finds or fetches'} (Python {self.version})"


def find_starter(chosen: str, own_python: str, variables: Mapping[str, str]) -> Starter:
    """Find what can make it: the chosen program, Blender's Python, uv, other Pythons; raises MissingDependency."""
    # programs started from a desktop often lack folders of the PATH that terminals have
    more = () if os.name == "nt" else map(os.path.expanduser, UNIX_FOLDERS)
    path = os.pathsep.join(filter(None, (variables.get("PATH"), *more)))
    names = ["uv", *(f"python{version}" for version in reversed(locks.PYTHONS)), "python3", "python"]
    others = (found for name in names if (found := shutil.which(name, path=path)))
    tried = []
    for program in [chosen] if chosen else [own_python, *others]:
        version, has_venv = _ask(program)
        if version in locks.PYTHONS and has_venv:
            return Starter(program, version)
        if Path(program).stem.lower() == "uv" and Path(program).is_file():  # it needs no venv
            version, _ = _ask(own_python)
            is_known = version in locks.PYTHONS
            return Starter(own_python if is_known else "", version if is_known else FETCHED_PYTHON, program)
        tried.append(program + (f" (Python {version}{'' if has_venv else ' without venv'})" if version else ""))
    raise MissingDependency(
        f"Nothing here can make a Python environment. Tried: {', '.join(tried)}.",
        f"Install Python {locks.PYTHONS[0]} to {locks.PYTHONS[-1]} with venv (Debian and Ubuntu: python3-venv), or uv.",
    )


def _ask(python: str) -> tuple[str, bool]:
    """Return the version of a Python, empty where it does not answer, and whether it can make environments."""
    options = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    try:
        process = processes.start([python, "-I", "-c", PROBE], **options)
        said, _ = process.communicate(timeout=PROBE_SECONDS)
    except OSError:
        return "", False
    except subprocess.TimeoutExpired:
        processes.end(process)
        return "", False
    found = re.fullmatch(r"(\d+ \d+) (\d+) (True|False)\s*", said.decode("ascii", "replace"))
    if not found:
        return "", False
    version, bits, has_venv = found.groups()
    return version.replace(" ", ".") + ("" if bits == "64" else f" of {bits} bits"), has_venv == "True"


# --- where packages come from; KaRF itself names no place ------------------------------------------------------------
@dataclass(frozen=True)
class Source:
    """Where packages come from, and the environment variables that tell uv."""

    sentence: str
    variables: dict[str, str] = field(default_factory=dict)


def find_source(variables: Mapping[str, str], wheels: Path | None = None) -> Source:
    """Return a folder of wheels, the index that uv is set to, that of pip, else the usual one."""
    if wheels is not None:
        return Source(f"the folder {wheels}, without network")
    for name in ("UV_DEFAULT_INDEX", "UV_INDEX_URL", "PIP_INDEX_URL"):
        if url := variables.get(name):
            told = {"UV_DEFAULT_INDEX": url} if name.startswith("PIP") else {}
            return Source(f"the index {_without_login(url)} (variable {name})", told)
    for path in _pip_files(variables):
        if url := _index_in(path):
            return Source(f"the index {_without_login(url)} (of {path})", {"UV_DEFAULT_INDEX": url})
    return Source("the Python Package Index (or another, where uv.toml names one)")


def _without_login(url: str) -> str:
    return re.sub(r"(?<=//)[^/?#]*@", "", url)


def _pip_files(variables: Mapping[str, str]) -> list[Path]:
    """Return pip's files of settings, the user's own first, as its documentation lists them."""
    chosen = variables.get("PIP_CONFIG_FILE")
    if os.name == "nt":
        files = [Path(variables[name], "pip", "pip.ini") for name in ("APPDATA", "PROGRAMDATA") if variables.get(name)]
    else:
        user = Path(variables.get("HOME") or os.curdir)
        own = Path(variables.get("XDG_CONFIG_HOME") or user / ".config")
        folders = (own / "pip", user / ".pip", user / "Library" / "Application Support" / "pip", "/etc/xdg/pip", "/etc")
        files = [Path(folder, "pip.conf") for folder in folders]
    return [Path(chosen), *files] if chosen else files


def _index_in(path: Path) -> str:
    parser = configparser.RawConfigParser()
    try:
        parser.read(path, encoding="utf-8")
    except (OSError, configparser.Error, UnicodeDecodeError):
        return ""
    names = (name for name in ("install", "global") if parser.has_option(name, "index-url"))
    return next((parser[name]["index-url"] for name in names), "")


# --- commands for people -----------------------------------------------------------------------------------------------
def shell_line(command: Sequence[str], shell: str) -> str:
    """Return a command as one line for a shell: `posix`, `powershell` or `cmd`."""
    if shell == "posix":
        return shlex.join(command)
    if shell == "powershell":
        words = [word if PLAIN.fullmatch(word) else "'" + word.replace("'", "''") + "'" for word in command]
        return " ".join(["&", *words])
    # a quotation mark cannot be in a Windows path, and no other argument has one
    return " ".join(word if PLAIN.fullmatch(word) else f'"{word}"' for word in command)
