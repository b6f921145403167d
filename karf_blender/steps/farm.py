"""Step 7: a camera's frames as a job for a render farm."""

from collections.abc import Iterable
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

import bpy

from ..engine_api import render_bundle
from ..project import folders
from . import requests
from .render import camera_folder, write_sequence


def farm_bundle(
    scene: bpy.types.Scene,
    camera: bpy.types.Object | None = None,
    frames: Iterable[int] | None = None,
    out: str | Path | None = None,
    per_task: int = 10,
    python: str = "python3",
) -> Path:
    """Write a bundle that renders what a camera sees, recolored, with the swatches of each frame; see docs/farm.md.

    Args:
        scene: The scene.
        camera: Default: the scene's.
        frames: Their numbers; default: the scene's range.
        out: The bundle's folder, new or empty; default: a new one, `farm/<camera>` in the output folder.
        per_task: How many frames a task renders.
        python: The Python of the farm's machines that has the engine's packages.

    Returns:
        The bundle's folder.

    Raises:
        KarfError: There is no camera, palette or frame, the project is damaged, or `out` is taken.
    """
    out = Path(out).absolute() if out else _free(folders.out_folder(scene) / "farm" / camera_folder(scene, camera).name)
    with TemporaryDirectory() as folder:
        cameras, edits = write_sequence(scene, camera, frames, Path(folder))
        _, options = requests.pictures(scene, str(cameras), edits, out, "render")
        pictures = {name: options[name] for name in ("base", "format", "alpha")}
        return render_bundle(
            folders.project_of(scene).folder,
            out,
            views=str(cameras),
            edit=edits,
            per_task=per_task,
            python=python,
            **pictures,
        )


def _free(folder: Path) -> Path:
    """The folder, or the next of its name that is not there yet."""
    numbered = (folder.with_name(f"{folder.name}_{number}") for number in count(2))
    return folder if not folder.exists() else next(other for other in numbered if not other.exists())
