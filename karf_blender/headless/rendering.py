"""Pictures, and the cameras that take them."""

from collections.abc import Iterable
from pathlib import Path

import bpy

from .. import steps
from ..engine_api import PlannedColorway
from ..pictures import sequences
from ..project import folders
from ..tasks import runner
from .context import scene_of


def render_view(scene: bpy.types.Scene | None = None, size: str | int | None = None) -> Path:
    """Write the active view recolored.

    Args:
        scene: Default: the context's.
        size: As of `render_captured`; `shown`: the preview as it is shown, without the engine.

    Returns:
        The picture's path.
    """
    scene = scene_of(scene)
    if size == "shown":
        return steps.save_shown(scene)
    runner.wait(steps.render_view(scene, size))
    (path,) = sequences.files_in(folders.out_folder(scene) / "recolor", [scene.karf.active_view])
    return path


def render_captured(
    views: str = "all",
    out: str | Path | None = None,
    scene: bpy.types.Scene | None = None,
    skip_existing: bool | None = None,
    size: str | int | None = None,
) -> Path:
    """Write captured views recolored.

    Args:
        views: `all`, `train`, `test` or names with commas.
        out: Output folder; default: the panel's.
        scene: Default: the context's.
        skip_existing: Whether to keep pictures that would come out the same; default: the panel's.
        size: `photo`: all pixels of the photos, in files of their kind (PNG, TIFF or EXR); `learned`: what was learned
            from; or the long side in pixels. Default: the panel's.

    Returns:
        The folder of the pictures.
    """
    _set_out(scene_of(scene), out, skip_existing)
    runner.wait(steps.render_captured(scene_of(scene), views, size))
    return folders.out_folder(scene_of(scene)) / "recolor"


def preview_camera(
    path: str | Path,
    camera: bpy.types.Object | None = None,
    long_side: int = 512,
    scene: bpy.types.Scene | None = None,
) -> Path:
    """Write what a camera sees now with the swatches as they stand, by the warm engine, which stays for the next one.

    Args:
        path: The PNG to write.
        camera: Default: the scene's.
        long_side: Pixels; the scene's render size is never enlarged.
        scene: Default: the context's.

    Returns:
        The picture's path.
    """
    steps.write_preview(scene_of(scene), camera, Path(path), long_side)
    return Path(path)


def render_sequence(
    camera: bpy.types.Object | None = None,
    frames: Iterable[int] | None = None,
    out: str | Path | None = None,
    scene: bpy.types.Scene | None = None,
    skip_existing: bool | None = None,
) -> Path:
    """Write what a Blender camera sees, recolored, with the swatches of each frame, and load it.

    Args:
        camera: Default: the scene's.
        frames: Numbers of the frames; default: the scene's range.
        out: Output folder; default: the panel's.
        scene: Default: the context's.
        skip_existing: Whether to keep frames that would come out the same; default: the panel's.

    Returns:
        The folder of the pictures, frame_0001.png and so on.
    """
    scene = scene_of(scene)
    _set_out(scene, out, skip_existing)
    runner.wait(steps.render_camera(scene, camera, steps.frame_range(scene) if frames is None else frames))
    return steps.camera_folder(scene, camera) / "recolor"


def farm_bundle(
    camera: bpy.types.Object | None = None,
    frames: Iterable[int] | None = None,
    out: str | Path | None = None,
    per_task: int = 10,
    python: str = "python3",
    scene: bpy.types.Scene | None = None,
) -> Path:
    """Write what a Blender camera sees, recolored, as a job for a render farm; see docs/farm.md.

    Args:
        camera: Default: the scene's.
        frames: Numbers of the frames; default: the scene's range.
        out: The bundle's folder, new or empty; default: a new one, `farm/<camera>` in the output folder.
        per_task: How many frames a task renders.
        python: The Python of the farm's machines that has the engine's packages.
        scene: Default: the context's.

    Returns:
        The bundle's folder.
    """
    scene = scene_of(scene)
    numbers = steps.frame_range(scene) if frames is None else frames
    return steps.camera_bundle(scene, camera, numbers, Path(out).absolute() if out else None, per_task, python)


def build_compositor(
    view: str = "", layers: str | Path | None = None, driven: bool = False, scene: bpy.types.Scene | None = None
) -> bpy.types.Node:
    """Recolor a view by nodes in the scene's compositor, with a color socket for each swatch.

    Args:
        view: Name of a captured view; default: the active one.
        layers: A layered picture that the engine has written already, of any camera; then no view is rendered.
        driven: Whether the sockets follow the scene's swatches; else they begin with them and can be set by hand.
        scene: Default: the context's.

    Returns:
        The group's node.
    """
    scene = scene_of(scene)
    if layers is not None:
        return steps.place_layers(scene, Path(layers).absolute(), driven)
    task = steps.build_compositor(scene, view, driven)
    runner.wait(task)
    return steps.compositor_node(scene, view)


def colorways(
    sheet: str | Path,
    views: str = "all",
    out: str | Path | None = None,
    predict_only: bool = False,
    scene: bpy.types.Scene | None = None,
) -> tuple[PlannedColorway, ...]:
    """Write every colorway of a sheet in every view, with a table and a contact sheet.

    Args:
        sheet: CSV or JSON: a colorway, an object and a color a row; see docs/files.md.
        views: `all`, `train`, `test`, names with commas, or the path of a camera file.
        out: The folder; default: `colorways/<sheet>` in the output folder.
        predict_only: Render nothing; needs no engine.
        scene: Default: the context's.

    Returns:
        The colorways, each with its edit and the predicted colors.
    """
    scene, sheet = scene_of(scene), Path(sheet).absolute()
    if not predict_only:
        runner.wait(steps.render_colorways(scene, sheet, views, Path(out).absolute() if out else None))
    return steps.predict_colorways(scene, sheet)


def show_frames(folder: str | Path | None = None, scene: bpy.types.Scene | None = None) -> bpy.types.Image:
    """Load rendered frames as one image, a sequence where their names count up.

    Args:
        folder: Of the pictures; default: those rendered last.
        scene: Default: the context's.
    """
    return steps.show_frames(scene_of(scene), Path(folder).absolute() if folder else None)


def add_strip(folder: str | Path | None = None, scene: bpy.types.Scene | None = None) -> "bpy.types.Strip":
    """Put rendered frames into the scene's sequencer as a strip; arguments as those of `show_frames`."""
    return steps.add_strip(scene_of(scene), Path(folder).absolute() if folder else None)


def export_cameras(
    path: str | Path,
    camera: bpy.types.Object | None = None,
    frames: Iterable[int] | None = None,
    scene: bpy.types.Scene | None = None,
) -> Path:
    """Write a Blender camera as a transforms.json, with poses relative to the rig.

    Args:
        path: The file.
        camera: Default: the scene's.
        frames: Numbers of the frames; default: the scene's range.
        scene: Default: the context's.

    Returns:
        The file's path.
    """
    scene, path = scene_of(scene), Path(path).absolute()
    steps.export_cameras(scene, path, camera, steps.frame_range(scene) if frames is None else frames)
    return path


def import_cameras(path: str | Path, scene: bpy.types.Scene | None = None) -> bpy.types.Object:
    """Make one animated camera of the cameras in a transforms.json, below the rig; it becomes the scene's.

    Returns:
        The camera.
    """
    return steps.import_cameras(scene_of(scene), Path(path).absolute())


def _set_out(scene: bpy.types.Scene, out: str | Path | None, skip_existing: bool | None = None) -> None:
    if out is not None:
        scene.karf.out = folders.stored(Path(out).absolute())
    if skip_existing is not None:
        scene.karf.skip_existing = skip_existing
