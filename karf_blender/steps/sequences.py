"""Step 7: rendered frames back in Blender, as an image sequence and as a strip."""

from pathlib import Path

import bpy

from .. import progress
from ..engine_api import BadRequest, Message, open_capture
from ..pictures import sequences
from ..project import folders

STANDARD = ("Standard", "Raw")  # view transforms that show sRGB colors as they are


def show_frames(scene: bpy.types.Scene, folder: str | Path | None = None, is_wanted: bool = True) -> bpy.types.Image:
    """Show rendered frames in the Image Editors, as a sequence where their names count up.

    Args:
        scene: The scene.
        folder: Of the pictures; default: those rendered last.
        is_wanted: The user asked for them now; else a picture that is being painted on is left alone.

    Raises:
        BadRequest: There are none.
    """
    files = frames_in(scene, folder)
    return sequences.show(files, _first_frame(files), is_wanted)


def add_strip(scene: bpy.types.Scene, folder: str | Path | None = None) -> "bpy.types.Strip":
    """Put rendered frames into the scene's sequencer; folder and errors as those of `show_frames`."""
    files = frames_in(scene, folder)
    say_view_transform(scene)
    return sequences.add_strip(scene, files, _first_frame(files), f"KaRF {files[0].parent.parent.name}")


def say_view_transform(scene: bpy.types.Scene) -> None:
    """Warn of a view transform that shows other colors in the compositor and the sequencer than the files have."""
    transform = scene.view_settings.view_transform
    if transform not in STANDARD:
        progress.warn(
            Message(
                "The view transform {transform} changes colors: choose Standard to show them unchanged.",
                transform=transform,
            )
        )


def frames_in(scene: bpy.types.Scene, folder: str | Path | None = None) -> list[Path]:
    """The pictures of a folder (None: those rendered last); of a camera's frames those of its last job alone."""
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
