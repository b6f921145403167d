"""Every step for scripts: `blender --background --python script.py`, or a running Blender's console.

    from bl_ext.user_default.karf.karf_blender import headless as karf

Each function blocks until its work is done and raises KarfError (sentence and hint) where it fails. `scene` defaults to
the context's. Colors are sRGB triples in [0, 1] or "#rrggbb". See docs/blender.md for a whole script.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import bpy

from . import steps
from .engine_api import Capture, Edit, ErrorSummary, Palette, PlannedColorway, hex_to_rgb
from .pictures import sequences
from .project import captures, folders
from .rig.cameras import Options
from .swatches import edits
from .tasks import runner

Color = str | Sequence[float]


def import_capture(
    path: str | Path, project: str | Path | None = None, scene: bpy.types.Scene | None = None, **options: Any
) -> Capture:
    """Build the cameras of a capture in the scene.

    Args:
        path: The capture's folder or camera file.
        project: Folder of all that is learned; default: beside the .blend.
        scene: Default: the context's.
        options: Those of `rig.cameras.Options`.

    Returns:
        The capture; its `remarks` say what could not be had.
    """
    folder = Path(project).absolute() if project else None
    return steps.import_capture(_scene(scene), Path(path).absolute(), folder, Options(**options))


def find_poses(photos: str | Path, scene: bpy.types.Scene | None = None, **options: Any) -> Capture:
    """Find the camera poses of a folder of photos, or of a video, and import the capture that they make.

    Args:
        photos: The folder or the video.
        scene: Default: the context's.
        options: Those of `rig.cameras.Options`.

    Returns:
        The capture, kept in a new project folder.
    """
    scene = _scene(scene)
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
    return steps.reprojection_error(_scene(scene), view)


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
        _scene(scene).karf.nerf = folders.stored(Path(nerf).absolute())
    runner.wait(steps.learn_scene(_scene(scene), preset, overrides))
    return folders.project_of(_scene(scene)).finished("geometry")


def segment(masks: str | Path | None = None, scene: bpy.types.Scene | None = None) -> dict[str, Any]:
    """Segment the objects.

    Args:
        masks: Folder of coarse masks, `<object>/<photo name>.png`; default: the panel's.
        scene: Default: the context's.

    Returns:
        The stage's entry in the project.
    """
    runner.wait(steps.segment(_scene(scene), Path(masks).absolute() if masks else None))
    return folders.project_of(_scene(scene)).finished("segmentation")


def extract_palette(scene: bpy.types.Scene | None = None) -> tuple[Palette, ...]:
    """Extract and learn the palettes, prepare the active view and show it.

    Returns:
        The palettes as learned, one an object.
    """
    runner.wait(steps.extract_palette(_scene(scene)))
    return edits.learned(_scene(scene))


def set_swatch(object_name: str, index: int, color: Color, scene: bpy.types.Scene | None = None) -> None:
    """Give a swatch a color.

    Args:
        object_name: Name of the object.
        index: Number of the swatch, from 1: swatch 0 is black and frozen.
        color: sRGB in [0, 2], or "#rrggbb".
        scene: Default: the context's.
    """
    edits.set_color(_scene(scene), object_name, index, _color(color))


def becomes(
    object_name: str, source: Color, target: Color, rule: str = "becomes", scene: bpy.types.Scene | None = None
) -> None:
    """Set an object's swatches so that one color of it becomes another.

    Args:
        object_name: Name of the object.
        source: A color of the object as it is in the photos: sRGB in [0, 1], or "#rrggbb".
        target: What it shall become.
        rule: `becomes` (the whole object gets a new paint) or `fewest` (as few changed swatches as possible).
        scene: Default: the context's.
    """
    steps.becomes(_scene(scene), object_name, _color(source), _color(target), rule)


def apply_edit(edit: str | Path | Edit, scene: bpy.types.Scene | None = None) -> None:
    """Set the swatches to an edit, or to that in an edit file."""
    if isinstance(edit, Edit):
        edits.apply_edit(_scene(scene), edit)
    else:
        steps.load_edit(_scene(scene), Path(edit))


def save_edit(path: str | Path, scene: bpy.types.Scene | None = None) -> None:
    """Write the swatches as an edit file."""
    steps.save_edit(_scene(scene), Path(path))


def show_view(view: str = "", scene: bpy.types.Scene | None = None) -> bpy.types.Image:
    """Show a captured view recolored, preparing it where needed.

    Args:
        view: Name of the view; default: the active one.
        scene: Default: the context's.

    Returns:
        The result image.
    """
    task = steps.show_view(_scene(scene), view)
    if task is not None:
        runner.wait(task)
    return _scene(scene).karf.result


def prepare_views(views: str = "all", scene: bpy.types.Scene | None = None) -> None:
    """Prepare captured views (`all`, `train`, `test` or names), so that they show without the engine."""
    runner.wait(steps.prepare_views(_scene(scene), views))


def render_view(scene: bpy.types.Scene | None = None, size: str | int | None = None) -> Path:
    """Write the active view recolored.

    Args:
        scene: Default: the context's.
        size: As of `render_captured`; `shown`: the preview as it is shown, without the engine.

    Returns:
        The picture's path.
    """
    scene = _scene(scene)
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
    _set_out(_scene(scene), out, skip_existing)
    runner.wait(steps.render_captured(_scene(scene), views, size))
    return folders.out_folder(_scene(scene)) / "recolor"


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
    scene = _scene(scene)
    _set_out(scene, out, skip_existing)
    runner.wait(steps.render_camera(scene, camera, steps.frame_range(scene) if frames is None else frames))
    return steps.camera_folder(scene, camera) / "recolor"


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
    scene = _scene(scene)
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
    scene, sheet = _scene(scene), Path(sheet).absolute()
    if not predict_only:
        runner.wait(steps.render_colorways(scene, sheet, views, Path(out).absolute() if out else None))
    return steps.predict_colorways(scene, sheet)


def show_frames(folder: str | Path | None = None, scene: bpy.types.Scene | None = None) -> bpy.types.Image:
    """Load rendered frames as one image, a sequence where their names count up.

    Args:
        folder: Of the pictures; default: those rendered last.
        scene: Default: the context's.
    """
    return steps.show_frames(_scene(scene), Path(folder).absolute() if folder else None)


def add_strip(folder: str | Path | None = None, scene: bpy.types.Scene | None = None) -> "bpy.types.Strip":
    """Put rendered frames into the scene's sequencer as a strip; arguments as those of `show_frames`."""
    return steps.add_strip(_scene(scene), Path(folder).absolute() if folder else None)


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
    scene, path = _scene(scene), Path(path).absolute()
    steps.export_cameras(scene, path, camera, steps.frame_range(scene) if frames is None else frames)
    return path


def import_cameras(path: str | Path, scene: bpy.types.Scene | None = None) -> bpy.types.Object:
    """Make one animated camera of the cameras in a transforms.json, below the rig; it becomes the scene's.

    Returns:
        The camera.
    """
    return steps.import_cameras(_scene(scene), Path(path).absolute())


def save(path: str | Path | None = None) -> None:
    """Save the .blend (at `path`, else where it is)."""
    if path is None:
        bpy.ops.wm.save_mainfile()
    else:
        bpy.ops.wm.save_as_mainfile(filepath=str(Path(path).absolute()))


def _scene(scene: bpy.types.Scene | None) -> bpy.types.Scene:
    return scene or bpy.context.scene


def _set_out(scene: bpy.types.Scene, out: str | Path | None, skip_existing: bool | None = None) -> None:
    if out is not None:
        scene.karf.out = folders.stored(Path(out).absolute())
    if skip_existing is not None:
        scene.karf.skip_existing = skip_existing


def _color(color: Color) -> Sequence[float]:
    return hex_to_rgb(color) if isinstance(color, str) else color
