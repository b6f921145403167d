"""What this computer is and which device torch could use, by the drivers that are there. No bpy, and no torch."""

import platform as system_of
from dataclasses import dataclass
from pathlib import Path

from ...engine_api import BadRequest

BUILDS = ("auto", "cpu", "cuda", "rocm", "mps")  # builds of torch
PROCESSORS = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "arm64", "aarch64": "arm64"}
SYSTEMS = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}
SYSTEM_BUILDS = {"linux": ("cpu", "cuda", "rocm"), "windows": ("cpu", "cuda"), "macos": ("cpu", "mps")}
NVIDIA = (  # files of its driver on Linux, under WSL, on Windows
    "proc/driver/nvidia/version",
    "dev/nvidiactl",
    "usr/lib/wsl/lib/libcuda.so.1",
    "Windows/System32/nvcuda.dll",
)
AMD = "dev/kfd"  # the compute driver; its folder below lists processors too, which have no graphics version
AMD_NODES = "sys/class/kfd/kfd/topology/nodes"


@dataclass(frozen=True)
class Machine:
    """platform: as recipes call it. devices: which of `cuda`, `rocm`, `mps` have their driver here."""

    platform: str
    devices: tuple[str, ...]

    @property
    def is_windows(self) -> bool:
        return self.platform.startswith("windows")

    @property
    def device_sentence(self) -> str:
        """What was found, for people."""
        found = {"cuda": "an NVIDIA driver", "rocm": "an AMD compute driver", "mps": "Apple silicon"}
        names = [found[device] for device in self.devices]
        return f"Found {' and '.join(names)}." if names else "No graphics driver that torch could use was found."


def look(system: str = "", processor: str = "", root: Path | None = None) -> Machine:
    """Find out what this computer is.

    Args:
        system: As Python names it (`Linux`); default: this one.
        processor: As Python names it (`x86_64`); default: this one.
        root: Where drivers' files are looked for; default: the system's root.
    """
    name = SYSTEMS.get(system or system_of.system(), (system or system_of.system()).lower())
    processor = (processor or system_of.machine()).lower()
    kind = PROCESSORS.get(processor, processor)
    if name == "linux" and kind == "arm64":
        kind = "aarch64"
    root = root or Path(Path.cwd().anchor)
    return Machine(f"{name}-{kind}", tuple(_devices(name, kind, root)))


def _devices(name: str, kind: str, root: Path) -> list[str]:
    if name == "macos":
        return ["mps"] if kind == "arm64" else []
    found = ["cuda"] if any((root / path).exists() for path in NVIDIA) else []
    return found + (["rocm"] if name == "linux" and _has_amd(root) else [])


def _has_amd(root: Path) -> bool:
    if not (root / AMD).exists():
        return False
    versions = (root / AMD_NODES).glob("*/properties")
    return any("gfx_target_version 0\n" not in _text(path) for path in versions)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii", errors="replace")
    except OSError:
        return "gfx_target_version 0\n"


def build_for(choice: str, machine: Machine) -> str:
    """The build of torch that is meant: `auto` is that of the first device, else `cpu`.

    Raises:
        BadRequest: There is no such build for this system.
    """
    if choice not in BUILDS:
        raise BadRequest(f"{choice!r} is not a build of torch.", f"Choose one of {', '.join(BUILDS)}.")
    if choice == "auto":
        return next(iter(machine.devices), "cpu")
    if choice not in builds_for(machine):
        raise BadRequest(f"There is no {choice} build of torch for {machine.platform}.", "Choose auto.")
    return choice


def builds_for(machine: Machine) -> tuple[str, ...]:
    """The builds of torch that there are for a computer's system."""
    return SYSTEM_BUILDS.get(machine.platform.partition("-")[0], ("cpu",))


def backend_of(build: str, machine: Machine) -> str:
    """The value of `uv --torch-backend` for a build; empty where the usual index has it, and thus the recipe."""
    system = machine.platform.partition("-")[0]
    if system == "linux" and build == "cpu":
        return "cpu"
    # uv finds the version that the driver allows
    return "auto" if (system, build) in (("linux", "rocm"), ("windows", "cuda")) else ""
