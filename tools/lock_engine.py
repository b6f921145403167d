"""Write the lock files from which uv makes the engine's environment: requirements with hashes.

    python3 tools/dev.py lock

Versions are those of requirements/engine.txt. There is a file for each system and build of torch, with the hashes of the
wheels for all Pythons, another for each system's optional pycolmap, and one for uv itself. A comment above each package
names its wheels with their sizes in bytes; where they lie is not kept.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote, urlsplit

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "karf_blender" / "engine" / "installer" / "requirements"
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
SYSTEMS = {  # as the extension calls them -> as uv does
    "linux-x86_64": "x86_64-manylinux_2_28",
    "linux-aarch64": "aarch64-manylinux_2_28",
    "windows-x86_64": "x86_64-pc-windows-msvc",
    "macos-arm64": "aarch64-apple-darwin",
}
USUAL_BUILDS = {  # that the usual index has
    "linux-x86_64": ("cuda",),
    "linux-aarch64": ("cuda",),
    "windows-x86_64": ("cpu",),
    "macos-arm64": ("mps", "cpu"),
}
OTHER_BUILDS = {  # of torch's own index: local version, and bytes where they are not known
    ("linux-x86_64", "cpu"): ("+cpu", 200_000_000),
    ("linux-x86_64", "rocm"): ("+rocm*", 5_000_000_000),
    ("linux-aarch64", "cpu"): ("+cpu", 200_000_000),
    ("windows-x86_64", "cuda"): ("+cu*", 2_900_000_000),
}
OLDEST_MACOS = "14.0"  # of which torch has files
TORCH = ("torch", "triton", "nvidia-", "cuda-")  # how the names begin of what only one build of torch needs


class Wheel(NamedTuple):
    """A package's file; an estimated size and no hash where the index that has it gives none."""

    name: str
    version: str
    file: str
    size: int
    sha256: str = ""


def main() -> int:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = project["dependencies"] + project["optional-dependencies"]["fast"]
    uv_pin = (ROOT / "requirements" / "lock.txt").read_text(encoding="utf-8").splitlines()[-1]
    OUT.mkdir(exist_ok=True)
    uv: set[Wheel] = set()
    for system in SYSTEMS:
        uv |= look_up(system, [uv_pin])
        usual = look_up(system, needed)
        for build in USUAL_BUILDS[system]:
            write(f"{system}-{build}", usual)
        shared = {wheel for wheel in usual if not wheel.name.startswith(TORCH)}
        torch = next(wheel.version for wheel in usual if wheel.name == "torch")
        for (other, build), (local, size) in OTHER_BUILDS.items():
            if other == system:
                # versions of CUDA and ROCm depend on the user's driver: only uv can choose them
                found = look_up(system, needed, "cpu", size) if build == "cpu" else set()
                found = found or {*shared, Wheel("torch", torch, f"torch-{torch}{local}-*.whl", size)}
                write(f"{system}-{build}", found)
        photos = look_up(system, project["dependencies"] + project["optional-dependencies"]["photos"]) - usual
        if photos:
            write(f"{system}-photos", photos)
    write("uv", uv)
    return 0


def write(name: str, wheels: Iterable[Wheel]) -> None:
    """Write a lock file."""
    packages: dict[tuple[str, str], list[Wheel]] = {}
    for wheel in sorted(wheels):
        packages.setdefault((wheel.name, wheel.version), []).append(wheel)
    lines = ["# written by `python3 tools/dev.py lock`"]
    for (package, version), files in packages.items():
        lines += [f"# {wheel.file} {wheel.size}" for wheel in files]
        hashes = [f"--hash=sha256:{wheel.sha256}" for wheel in files if wheel.sha256]
        lines.append(" \\\n    ".join([f"{package}=={version}", *hashes]))
    (OUT / f"{name}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    print(f"{name}: {len(packages)} packages", flush=True)


def look_up(system: str, requirements: list[str], backend: str = "", size: int = 0) -> set[Wheel]:
    """Find the wheels for all Pythons of these requirements and of all that they need, in the pinned versions.

    Args:
        system: One of SYSTEMS.
        requirements: As in pyproject.toml.
        backend: Build of torch of its own index; empty: the usual index.
        size: Of torch in bytes, where an index does not tell.

    Returns:
        Nothing where the system lacks a file, or torch's own index cannot be reached.
    """
    wheels: set[Wheel] = set()
    for python in PYTHONS:
        found = _compile(system, python, requirements, backend)
        if found is None:
            return set()
        wheels.update(_wheel(package, size) for package in found)
    return wheels


def _compile(system: str, python: str, requirements: list[str], backend: str) -> list[dict[str, Any]] | None:
    with tempfile.TemporaryDirectory() as folder:
        wanted, out = Path(folder) / "wanted.txt", Path(folder) / "pylock.toml"
        wanted.write_text("\n".join(requirements), encoding="utf-8")
        uv = Path(sys.executable).with_name("uv.exe" if os.name == "nt" else "uv")
        command = [uv, "pip", "compile", wanted, "--constraints", ROOT / "requirements" / "engine.txt"]
        command += ["--python-version", python, "--python-platform", SYSTEMS[system], "--only-binary", ":all:"]
        command += ["--generate-hashes", "--format", "pylock.toml", "--output-file", out]
        command += ["--no-header", "--quiet", "--no-config", *(["--torch-backend", backend] if backend else [])]
        variables = os.environ | {"MACOSX_DEPLOYMENT_TARGET": OLDEST_MACOS}
        done = subprocess.run(list(map(str, command)), env=variables, capture_output=True, text=True)
        if done.returncode and (backend or "no wheels with a matching" in done.stderr):
            print(f"{system} {backend}, Python {python}: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
            return None
        if done.returncode:
            sys.exit(f"error: {system}, Python {python}:\n{done.stderr}")
        return tomllib.loads(out.read_text(encoding="utf-8"))["packages"]


def _wheel(package: dict[str, Any], size: int) -> Wheel:
    """The package's file that installers take."""
    files = {unquote(urlsplit(wheel["url"]).path).rpartition("/")[2]: wheel for wheel in package["wheels"]}
    # of builds for older and newer systems installers take that for the newer
    file = max(files, key=lambda name: "manylinux_2_28" in name)
    known = files[file]
    return Wheel(package["name"], package["version"], file, known.get("size", size), known["hashes"]["sha256"])


if __name__ == "__main__":
    sys.exit(main())
