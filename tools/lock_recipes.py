"""Write recipes.json: the files of which the extension makes the engine's environment, with sizes and hashes.

    python3 tools/dev.py lock

The versions are those of requirements/engine.txt. For each system and Python uv looks up which files these are. A
package of which a system has no file is left out with the extra that needs it, or the Python is left out as a whole.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "karf_blender" / "engine" / "managed" / "recipes.json"
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
SYSTEMS = {  # as the extension calls them -> as uv does
    "linux-x86_64": "x86_64-manylinux_2_28",
    "linux-aarch64": "aarch64-manylinux_2_28",
    "windows-x86_64": "x86_64-pc-windows-msvc",
    "macos-arm64": "aarch64-apple-darwin",
}
OLDEST_MACOS = "14.0"  # of which torch has files
EXTRAS = ("photos", "fast")  # of pyproject.toml
TORCH = ("torch", "triton", "nvidia-", "cuda-")  # how the names begin of what only one build of torch needs


def main() -> int:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    uv_pin = (ROOT / "requirements" / "lock.txt").read_text(encoding="utf-8").splitlines()[-1]
    wheels: dict[str, dict[str, Any]] = {}
    recipes: dict[str, dict[str, dict[str, list[str]]]] = {}
    for system in SYSTEMS:
        for python in PYTHONS:
            found = look_up(system, python, project["dependencies"])
            if found is None:
                print(f"{system}, Python {python}: no files")
                continue
            parts = {
                "uv": look_up(system, python, [uv_pin]),
                "base": {name: wheel for name, wheel in found.items() if not wheel["name"].startswith(TORCH)},
                "torch": {name: wheel for name, wheel in found.items() if wheel["name"].startswith(TORCH)},
            }
            for extra in EXTRAS:
                more = look_up(system, python, project["dependencies"] + project["optional-dependencies"][extra])
                if more is not None:
                    parts[extra] = {name: more[name] for name in more.keys() - found.keys()}
            for part in parts.values():
                wheels.update(part)
            recipes.setdefault(system, {})[python] = {name: sorted(part) for name, part in parts.items()}
            megabytes = sum(wheel["size"] for part in parts.values() for wheel in part.values()) / 1e6
            print(f"{system}, Python {python}: {', '.join(parts)}; {megabytes:.0f} MB", flush=True)
    content = {"schema": "karf-recipes/1", "wheels": dict(sorted(wheels.items())), "recipes": recipes}
    OUT.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return 0


def look_up(system: str, python: str, requirements: list[str]) -> dict[str, dict[str, Any]] | None:
    """Find the wheels of these requirements and of all that they need, in the pinned versions.

    Returns:
        File name -> name, version, size in bytes and SHA-256; None where the system lacks a file.
    """
    with tempfile.TemporaryDirectory() as folder:
        wanted, out = Path(folder) / "wanted.txt", Path(folder) / "pylock.toml"
        wanted.write_text("\n".join(requirements), encoding="utf-8")
        uv = Path(sys.executable).with_name("uv.exe" if os.name == "nt" else "uv")
        command = [uv, "pip", "compile", wanted, "--constraints", ROOT / "requirements" / "engine.txt"]
        command += ["--python-version", python, "--python-platform", SYSTEMS[system], "--only-binary", ":all:"]
        command += ["--format", "pylock.toml", "--output-file", out, "--no-header", "--quiet", "--no-config"]
        variables = os.environ | {"MACOSX_DEPLOYMENT_TARGET": OLDEST_MACOS}
        done = subprocess.run(list(map(str, command)), env=variables, capture_output=True, text=True)
        if "no wheels with a matching" in done.stderr:
            return None
        if done.returncode:
            sys.exit(f"error: {system}, Python {python}:\n{done.stderr}")
        packages = tomllib.loads(out.read_text(encoding="utf-8"))["packages"]
    return dict(_wheel(package) for package in packages)


def _wheel(package: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """A package's file; where it lies is not kept."""
    files = {unquote(urlsplit(wheel["url"]).path).rpartition("/")[2]: wheel for wheel in package["wheels"]}
    # of builds for older and newer systems installers take that for the newer
    file = max(files, key=lambda name: "manylinux_2_28" in name)
    entry = {"name": package["name"], "version": package["version"]}
    return file, {**entry, "size": files[file]["size"], "sha256": files[file]["hashes"]["sha256"]}


if __name__ == "__main__":
    sys.exit(main())
