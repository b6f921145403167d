"""Every step for scripts: `blender --background --python script.py`, or a running Blender's console.

    from bl_ext.user_default.karf.karf_blender import headless as karf

These are the functions of `steps`, each of which here blocks until its work is done and returns what came of it, and
raises KarfError (sentence and hint) where it fails. `scene` defaults to the context's. Colors are sRGB triples in [0, 1]
or "#rrggbb". See docs/blender.md for a whole script.
"""

import inspect
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import bpy

from .. import steps
from ..engine_api import Edit, KarfError, ObjectMatch
from ..steps import Color
from ..steps.engine import (
    engine_files,
    engine_status,
    examine_engine,
    install_engine,
    plan_engine,
    remove_engine,
    repair_engine,
)
from ..tasks import runner
from ..tasks.task import Task


def run(step: Any) -> Any:
    """What a step gives: the result of its task, for which this blocks, or what it has returned at once."""
    if not isinstance(step, Task):
        return step
    runner.wait(step)
    return step.result()


def _for_scripts(step: Callable) -> Callable:
    """A step that runs its task; the scene is named, by default the context's, or stands anywhere."""

    @wraps(step)
    def run_step(*arguments, scene=None, **options):
        others = [each for each in arguments if not isinstance(each, bpy.types.Scene)]
        scenes = [each for each in arguments if isinstance(each, bpy.types.Scene)]
        return run(step(scene or next(iter(scenes), bpy.context.scene), *others, **options))

    signature = inspect.signature(step)
    scene, *others = signature.parameters.values()
    named = [*others, scene.replace(kind=inspect.Parameter.KEYWORD_ONLY, default=None)]
    run_step.__signature__ = signature.replace(parameters=sorted(named, key=lambda each: each.kind))
    return run_step


add_color = _for_scripts(steps.add_color)
add_strip = _for_scripts(steps.add_strip)
apply_edit = _for_scripts(steps.apply_edit)
becomes = _for_scripts(steps.becomes)
build_compositor = _for_scripts(steps.build_compositor)
check_capture = _for_scripts(steps.check_capture)
find_chart = _for_scripts(steps.find_chart)
choose_look = _for_scripts(steps.choose_look)
colorways = _for_scripts(steps.colorways)
export_cameras = _for_scripts(steps.export_cameras)
export_scene = _for_scripts(steps.export_scene)
export_splat = _for_scripts(steps.export_splat)
extract_palette = _for_scripts(steps.extract_palette)
farm_bundle = _for_scripts(steps.farm_bundle)
find_poses = _for_scripts(steps.find_poses)
follow_splat = _for_scripts(steps.follow_splat)
import_cameras = _for_scripts(steps.import_cameras)
import_capture = _for_scripts(steps.import_capture)
import_splat = _for_scripts(steps.import_splat)
keep_look = _for_scripts(steps.keep_look)
learn_all = _for_scripts(steps.learn_all)
learn_scene = _for_scripts(steps.learn_scene)
learn_splats = _for_scripts(steps.learn_splats)
link_swatches = _for_scripts(steps.link_swatches)
merge_swatch = _for_scripts(steps.merge_swatch)
prepare_views = _for_scripts(steps.prepare_views)
preview_camera = _for_scripts(steps.preview_camera)
protect_neutrals = _for_scripts(steps.protect_neutrals)
remove_color = _for_scripts(steps.remove_color)
render_captured = _for_scripts(steps.render_captured)
render_looks = _for_scripts(steps.render_looks)
render_sequence = _for_scripts(steps.render_sequence)
render_view = _for_scripts(steps.render_view)
reprojection_error = _for_scripts(steps.reprojection_error)
save_edit = _for_scripts(steps.save_edit)
segment = _for_scripts(steps.segment)
set_surface = _for_scripts(steps.set_surface)
set_swatch = _for_scripts(steps.set_swatch)
show_frames = _for_scripts(steps.show_frames)
show_scene = _for_scripts(steps.show_scene)
show_view = _for_scripts(steps.show_view)


def match_picture(
    picture: str | Path | bpy.types.Image, view: str = "", scene: bpy.types.Scene | None = None
) -> tuple[ObjectMatch, ...]:
    """Show a view (default: the active one), and match it to a picture of it; see `steps.match_picture`."""
    scene = scene or bpy.context.scene
    show_view(view, scene=scene)
    return steps.match_picture(scene, picture)


def save(path: str | Path | None = None) -> None:
    """Save the .blend (at `path`, else where it is)."""
    if path is None:
        bpy.ops.wm.save_mainfile()
    else:
        bpy.ops.wm.save_as_mainfile(filepath=str(Path(path).absolute()))


__all__ = [
    "Color",
    "Edit",
    "KarfError",
    "add_color",
    "add_strip",
    "apply_edit",
    "becomes",
    "build_compositor",
    "check_capture",
    "choose_look",
    "colorways",
    "engine_files",
    "engine_status",
    "examine_engine",
    "export_cameras",
    "export_scene",
    "export_splat",
    "extract_palette",
    "farm_bundle",
    "find_chart",
    "find_poses",
    "follow_splat",
    "import_cameras",
    "import_capture",
    "import_splat",
    "install_engine",
    "keep_look",
    "learn_all",
    "learn_scene",
    "learn_splats",
    "link_swatches",
    "match_picture",
    "merge_swatch",
    "plan_engine",
    "prepare_views",
    "preview_camera",
    "protect_neutrals",
    "remove_color",
    "remove_engine",
    "render_captured",
    "render_looks",
    "render_sequence",
    "render_view",
    "repair_engine",
    "reprojection_error",
    "run",
    "save",
    "save_edit",
    "segment",
    "set_surface",
    "set_swatch",
    "show_frames",
    "show_scene",
    "show_view",
]
