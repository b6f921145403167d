"""A folder of wheels in place of the network: whether all is there, and what somebody must fetch. No bpy."""

from collections.abc import Sequence
from pathlib import Path

from ...engine_api import DataError
from . import shells
from .recipes import Recipe, Wheel

MOST_NAMED = 6  # files named in a sentence


def build_in(folder: Path, recipe: Recipe, choice: str, build: str, backend: str) -> tuple[str, str]:
    """Which build of torch a folder has.

    Args:
        folder: The folder of wheels.
        recipe: The system's recipe.
        choice: What the user chose, perhaps `auto`.
        build: What that means on this computer.
        backend: uv's name of it; empty: the recipe's own files.

    Returns:
        The build, and its backend: `auto` takes what the folder has.
    """
    own = [wheel for wheel in recipe.parts["torch"] if wheel.name == "torch"]
    has_own = all((folder / wheel.file).is_file() for wheel in own)
    others = sorted(_kind(path) for path in _torches(folder, recipe))
    if has_own and (choice == "auto" or not backend):
        return build if not backend else ("cuda" if recipe.platform.startswith("linux") else "cpu"), ""
    if choice == "auto" and others:
        build = build if build in others else others[0]
    if build not in others:
        raise DataError(
            f"{folder} has no torch {recipe.torch_version} for {build} and Python {recipe.python} on {recipe.platform}.",
            f"Put a file torch-{recipe.torch_version}... for it there, or choose another build.",
        )
    return build, build


def _torches(folder: Path, recipe: Recipe) -> list[Path]:
    """Files of torch's version that are not the recipe's, by their Python and system."""
    tag = f"cp{recipe.python.replace('.', '')}"
    system = {"linux": "linux", "windows": "win", "macos": "macosx"}[recipe.platform.partition("-")[0]]
    return [path for path in folder.glob(f"torch-{recipe.torch_version}+*-{tag}-*.whl") if system in path.name]


def _kind(path: Path) -> str:
    """The build of a file `torch-2.13.0+cu130-...`."""
    local = path.name.partition("+")[2].partition("-")[0]
    return "cuda" if local.startswith("cu") else "rocm" if local.startswith("rocm") else local


def check(folder: Path, wheels: Sequence[Wheel]) -> None:
    """Raise DataError with the names of files that are not there, or not whole; hashes are checked by who unpacks."""
    missing = [wheel.file for wheel in wheels if not (folder / wheel.file).is_file()]
    if missing:
        more = f" and {len(missing) - MOST_NAMED} more" if len(missing) > MOST_NAMED else ""
        raise DataError(
            f"{folder} lacks {len(missing)} of {len(wheels)} files: {', '.join(missing[:MOST_NAMED])}{more}.",
            "Fetch them on another computer: steps.engine_files() gives their list and the command.",
        )
    for wheel in wheels:
        size = (folder / wheel.file).stat().st_size
        if size != wheel.size:
            raise DataError(
                f"{folder / wheel.file} has {size:,} bytes in place of {wheel.size:,}.", "Fetch this file again."
            )


def fetching(recipe: Recipe, wheels: Sequence[Wheel], shell: str) -> str:
    """A command that fetches files on another computer, of any system, into the folder `wheels`.

    Args:
        recipe: For which system and Python.
        wheels: The files.
        shell: One of `shells.SHELLS`.

    Returns:
        One line; it reads the list `karf-wheels.txt`, which `listing` gives.
    """
    tags = sorted({tag for wheel in wheels for tag in wheel.file[:-4].split("-")[-1].split(".")} - {"any"})
    abis = sorted({wheel.file[:-4].split("-")[-2] for wheel in wheels})
    command = ["python", "-m", "pip", "download", "--no-deps", "--only-binary", ":all:", "--require-hashes"]
    command += ["--implementation", "cp", "--python-version", recipe.python]
    command += [part for abi in abis for part in ("--abi", abi)]
    command += [part for tag in tags for part in ("--platform", tag)]
    return shells.line([*command, "--dest", "wheels", "--requirement", "karf-wheels.txt"], shell)


def listing(wheels: Sequence[Wheel]) -> str:
    """The text of `karf-wheels.txt`: one file a line, with its name and size for people."""
    return "".join(f"{wheel.requirement}  # {wheel.file}, {wheel.size:,} bytes\n" for wheel in wheels)
