"""Step 7: rendered frames back in Blender, and the render engine KaRF for 3D Views, stills and animations."""

from collections.abc import Iterable
from pathlib import Path

import bpy

from .. import compositor, progress
from ..engine_api import BadRequest, open_capture
from ..host import compat
from ..pictures import sequences
from ..project import folders
from ..render_engine.engine import NAME
from . import requests

STANDARD = ("Standard", "Raw")  # view transforms that show sRGB colors as they are
COPIED = "resolution_x resolution_y resolution_percentage pixel_aspect_x pixel_aspect_y fps fps_base".split()


# --- frames --------------------------------------------------------------------------------------------------------
def show_frames(scene: bpy.types.Scene, folder: str | Path | None = None, is_wanted: bool = True) -> bpy.types.Image:
    """Show rendered frames (default: the last ones) in the Image Editors, as a sequence where their names count up.

    Unless `is_wanted` by the user now, a picture that is being painted on is left alone.
    """
    files = _frames_in(scene, folder)
    return sequences.show(files, _first_frame(files), is_wanted)


def add_strip(scene: bpy.types.Scene, folder: str | Path | None = None) -> "bpy.types.Strip":
    """Put rendered frames (default: those rendered last) into the scene's sequencer."""
    files = _frames_in(scene, folder)
    warn_of_view_transform(scene)
    return sequences.add_strip(scene, files, _first_frame(files), f"KaRF {files[0].parent.parent.name}")


def warn_of_view_transform(scene: bpy.types.Scene) -> None:
    """Warn of a view transform that shows other colors in the compositor and the sequencer than the files have."""
    transform = scene.view_settings.view_transform
    if transform not in STANDARD:
        progress.warn(
            "The view transform {transform} changes colors: choose Standard to show them unchanged.",
            transform=transform,
        )


def _frames_in(scene: bpy.types.Scene, folder: str | Path | None) -> list[Path]:
    """Return the pictures of a folder (None: those rendered last); of a camera's frames those of its last job alone."""
    if folder is None and not scene.karf.frames:
        raise BadRequest("No frames have been rendered yet.", "Render captured views or a camera's frames first.")
    folder = Path(folder).absolute() if folder else folders.absolute(scene.karf.frames)
    cameras = folder.parent / "cameras.json"
    names = [view.name for view in open_capture(cameras, photos=False).views] if cameras.is_file() else None
    files = sequences.files_in(folder, names)
    if not files:
        raise BadRequest(
            "There are no frames in {folder}.", "Render captured views or a camera's frames first.", folder=folder
        )
    return files


def _first_frame(files: list[Path]) -> int:
    """The scene's frame of the first picture: a camera's frame says it, captured views begin with the first."""
    return sequences.number_of(files[0]) if files[0].stem.startswith("frame_") else 1


# --- render engine -------------------------------------------------------------------------------------------------
def use_engine(scene: bpy.types.Scene, spaces: Iterable["bpy.types.SpaceView3D"] = ()) -> None:
    """Let KaRF render the scene; `spaces` are 3D Views that show it rendered from now on."""
    scene.render.engine = NAME
    for space in spaces:
        space.shading.type = "RENDERED"
    warn_of_view_transform(scene)


def put_objects_in(scene: bpy.types.Scene) -> bpy.types.Scene:
    """Render the scene's own objects within the captured one, each hidden where the other is nearer.

    Returns a scene of the objects, rendered by the scene's former engine, or by EEVEE. A second call updates it.
    """
    requests.check_rig(scene)
    name = f"{scene.name} {compositor.OBJECTS}"
    objects = bpy.data.scenes.get(name)
    if objects is None:
        objects = bpy.data.scenes.new(name)
        objects.render.engine = compat.EEVEE if scene.render.engine == NAME else scene.render.engine
    _take_over(scene, objects)
    use_engine(scene)
    for each in (scene, objects):
        each.view_layers[0].use_pass_z = True
    compositor.build_over_scene(scene, objects)
    return objects


def _take_over(scene: bpy.types.Scene, objects: bpy.types.Scene) -> None:
    """Give the scene of the objects what the other one has now: all but the capture."""
    objects.camera, objects.world = scene.camera, scene.world
    objects.frame_start, objects.frame_end = scene.frame_start, scene.frame_end
    objects.view_settings.view_transform = scene.view_settings.view_transform
    objects.render.film_transparent = True
    for name in COPIED:
        setattr(objects.render, name, getattr(scene.render, name))
    source, target, rig = scene.collection, objects.collection, scene.karf.rig
    for held in (target.children, target.objects):
        for each in list(held):
            held.unlink(each)
    for collection in source.children:
        if rig.name not in collection.objects:
            target.children.link(collection)
    for item in source.objects:
        if item not in (rig, scene.karf.surface.item):
            target.objects.link(item)
