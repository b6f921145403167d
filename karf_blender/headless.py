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
from .engine_api import Capture, Edit, ErrorSummary, Palette, hex_to_rgb
from .project import captures, folders
from .rig.cameras import Options
from .swatches import edits
from .tasks import runner

Color = str | Sequence[float]


def import_capture(
    path: str | Path, project: str | Path | None = None, scene: bpy.types.Scene | None = None, **options: Any
) -> Capture:
    """Build the cameras of a capture (its folder or camera file) in the scene; options are those of `rig.cameras.Options`."""
    folder = Path(project).absolute() if project else None
    return steps.import_capture(_scene(scene), Path(path).absolute(), folder, Options(**options))


def find_poses(photos: str | Path, scene: bpy.types.Scene | None = None, **options: Any) -> Capture:
    """Find the camera poses of a folder of photos, or of a video, and import the capture that they make."""
    scene = _scene(scene)
    runner.wait(steps.find_poses(scene, Path(photos).absolute(), Options(**options)))
    return captures.of(scene)


def reprojection_error(view: str = "", scene: bpy.types.Scene | None = None) -> ErrorSummary:
    """Count, median and worst distance in pixels between the sparse points and where a view (default: the active one)
    shows them in its photo."""
    return steps.reprojection_error(_scene(scene), view)


def learn_scene(
    preset: str = "",
    overrides: Sequence[str] = (),
    scene: bpy.types.Scene | None = None,
    nerf: str | Path | None = None,
) -> dict[str, Any]:
    """Learn the geometry; overrides are `stage.field=value`. nerf: checkpoint of a NeRF that is taken instead. Returns
    the stage's summary in the project (seconds, metrics)."""
    if nerf is not None:
        _scene(scene).karf.nerf = folders.stored(Path(nerf).absolute())
    runner.wait(steps.learn_scene(_scene(scene), preset, overrides))
    return folders.project_of(_scene(scene)).finished("geometry")


def segment(masks: str | Path | None = None, scene: bpy.types.Scene | None = None) -> dict[str, Any]:
    """Segment the objects that the masks `masks/<object>/<photo name>.png` show. Returns the stage's summary in the project."""
    runner.wait(steps.segment(_scene(scene), Path(masks).absolute() if masks else None))
    return folders.project_of(_scene(scene)).finished("segmentation")


def extract_palette(scene: bpy.types.Scene | None = None) -> tuple[Palette, ...]:
    """Extract and learn the palettes, prepare the active view and show it. Returns the palettes."""
    runner.wait(steps.extract_palette(_scene(scene)))
    return edits.learned(_scene(scene))


def set_swatch(object_name: str, index: int, color: Color, scene: bpy.types.Scene | None = None) -> None:
    """Give a swatch a color; index counts from 1 (swatch 0 is black and frozen)."""
    edits.set_color(_scene(scene), object_name, index, _color(color))


def becomes(
    object_name: str, source: Color, target: Color, rule: str = "becomes", scene: bpy.types.Scene | None = None
) -> None:
    """Set an object's swatches so that its color `source` becomes `target`; rule `becomes` or `fewest`."""
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
    """Show a captured view (default: the active one) recolored, preparing it where needed. Returns the result image."""
    task = steps.show_view(_scene(scene), view)
    if task is not None:
        runner.wait(task)
    return _scene(scene).karf.result


def prepare_views(views: str = "all", scene: bpy.types.Scene | None = None) -> None:
    """Prepare captured views (`all`, `train`, `test` or names), so that they show without the engine."""
    runner.wait(steps.prepare_views(_scene(scene), views))


def render_view(scene: bpy.types.Scene | None = None) -> Path:
    """Write the active view as shown. Returns the PNG's path."""
    return steps.render_view(_scene(scene))


def render_captured(views: str = "all", out: str | Path | None = None, scene: bpy.types.Scene | None = None) -> Path:
    """Write captured views recolored. Returns the folder of the PNGs."""
    _set_out(_scene(scene), out)
    runner.wait(steps.render_captured(_scene(scene), views))
    return folders.out_folder(_scene(scene)) / "recolor"


def render_sequence(
    camera: bpy.types.Object | None = None,
    frames: Iterable[int] | None = None,
    out: str | Path | None = None,
    scene: bpy.types.Scene | None = None,
) -> Path:
    """Write what a Blender camera (default: the scene's) sees in these frames (default: the scene's range).

    Returns the folder of the PNGs, frame_0001.png and so on.
    """
    scene = _scene(scene)
    _set_out(scene, out)
    runner.wait(steps.render_camera(scene, camera, steps.frame_range(scene) if frames is None else frames))
    return steps.camera_folder(scene, camera) / "recolor"


def export_cameras(
    path: str | Path,
    camera: bpy.types.Object | None = None,
    frames: Iterable[int] | None = None,
    scene: bpy.types.Scene | None = None,
) -> Path:
    """Write a Blender camera (default: the scene's) in these frames (default: the scene's range) as a transforms.json."""
    scene, path = _scene(scene), Path(path).absolute()
    steps.export_cameras(scene, path, camera, steps.frame_range(scene) if frames is None else frames)
    return path


def import_cameras(path: str | Path, scene: bpy.types.Scene | None = None) -> bpy.types.Object:
    """Make one animated camera of the cameras in a transforms.json, below the rig; returns it."""
    return steps.import_cameras(_scene(scene), Path(path).absolute())


def save(path: str | Path | None = None) -> None:
    """Save the .blend (at `path`, else where it is)."""
    if path is None:
        bpy.ops.wm.save_mainfile()
    else:
        bpy.ops.wm.save_as_mainfile(filepath=str(Path(path).absolute()))


def _scene(scene: bpy.types.Scene | None) -> bpy.types.Scene:
    return scene or bpy.context.scene


def _set_out(scene: bpy.types.Scene, out: str | Path | None) -> None:
    if out is not None:
        scene.karf.out = folders.stored(Path(out).absolute())


def _color(color: Color) -> Sequence[float]:
    return hex_to_rgb(color) if isinstance(color, str) else color
