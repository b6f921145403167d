"""From a capture to palettes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy

from .. import steps
from ..engine_api import Capture, ErrorSummary, Palette
from ..project import captures, folders
from ..rig.cameras import Options
from ..swatches import edits
from ..tasks import runner
from .context import scene_of


def import_capture(
    path: str | Path,
    project: str | Path | None = None,
    scene: bpy.types.Scene | None = None,
    holdout: int | None = None,
    **options: Any,
) -> Capture:
    """Build the cameras of a capture in the scene.

    Args:
        path: The capture's folder or camera file.
        project: Folder of all that is learned; default: beside the .blend.
        scene: Default: the context's.
        holdout: Keep every so many-th photo out of learning; default: as the project was learned, else none.
        options: Those of `rig.cameras.Options`.

    Returns:
        The capture; its `remarks` say what could not be had.
    """
    folder = Path(project).absolute() if project else None
    return steps.import_capture(scene_of(scene), Path(path).absolute(), folder, Options(**options), holdout)


def find_poses(photos: str | Path, scene: bpy.types.Scene | None = None, **options: Any) -> Capture:
    """Find the camera poses of a folder of photos, or of a video, and import the capture that they make.

    Args:
        photos: The folder or the video.
        scene: Default: the context's.
        options: Those of `rig.cameras.Options`.

    Returns:
        The capture, kept in a new project folder.
    """
    scene = scene_of(scene)
    runner.wait(steps.find_poses(scene, Path(photos).absolute(), Options(**options)))
    return captures.of(scene)


def reprojection_error(view: str = "", scene: bpy.types.Scene | None = None) -> ErrorSummary:
    """Measure how far the sparse points are from where a view shows them in its photo.

    Args:
        view: Name of a captured view; default: the active one.
        scene: Default: the context's.

    Returns:
        Count of points, and median and worst distance in pixels.
    """
    return steps.reprojection_error(scene_of(scene), view)


def learn_scene(
    preset: str = "",
    overrides: Sequence[str] = (),
    scene: bpy.types.Scene | None = None,
    nerf: str | Path | None = None,
) -> dict[str, Any]:
    """Learn the geometry.

    Args:
        preset: Name of the settings; default: the panel's.
        overrides: Single settings as `stage.field=value`.
        scene: Default: the context's.
        nerf: Checkpoint of a NeRF of another program, which is imported instead.

    Returns:
        The stage's entry in the project (seconds, metrics).
    """
    if nerf is not None:
        scene_of(scene).karf.nerf = folders.stored(Path(nerf).absolute())
    runner.wait(steps.learn_scene(scene_of(scene), preset, overrides))
    return folders.project_of(scene_of(scene)).finished("geometry")


def learn_all(
    preset: str = "",
    overrides: Sequence[str] = (),
    scene: bpy.types.Scene | None = None,
) -> tuple[Palette, ...]:
    """Learn the geometry, segment the objects of the panel's masks, extract the palettes and show the active view.

    Args:
        preset: Name of the settings; default: the panel's.
        overrides: Single settings as `stage.field=value`.
        scene: Default: the context's.

    Returns:
        The palettes as learned, one an object.
    """
    runner.wait(steps.learn_all(scene_of(scene), preset, overrides))
    return edits.learned(scene_of(scene))


def segment(masks: str | Path | None = None, scene: bpy.types.Scene | None = None) -> dict[str, Any]:
    """Segment the objects.

    Args:
        masks: Folder of coarse masks, `<object>/<photo name>.png`; default: the panel's.
        scene: Default: the context's.

    Returns:
        The stage's entry in the project.
    """
    runner.wait(steps.segment(scene_of(scene), Path(masks).absolute() if masks else None))
    return folders.project_of(scene_of(scene)).finished("segmentation")


def extract_palette(scene: bpy.types.Scene | None = None) -> tuple[Palette, ...]:
    """Extract and learn the palettes, prepare the active view and show it.

    Returns:
        The palettes as learned, one an object.
    """
    runner.wait(steps.extract_palette(scene_of(scene)))
    return edits.learned(scene_of(scene))
