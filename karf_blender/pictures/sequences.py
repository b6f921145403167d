"""Frames on disk as an image sequence in the Image Editors, and as a strip in the sequencer."""

import re
from collections.abc import Sequence
from pathlib import Path

import bpy

from ..engine_api import DataError
from ..host import compat, rendering, windows
from ..project import folders
from . import editors

NAME = f"{editors.PREFIX} frames"
SUFFIXES = (".png", ".tif", ".exr", ".jpg")  # suffixes of pictures that the engine writes


def files_in(folder: Path) -> list[Path]:
    """Return the newest picture of each name in a folder, which need not exist, sorted."""
    stems = {
        path.stem for path in folder.glob("*") if path.suffix.lower() in SUFFIXES and not path.name.startswith(".")
    }
    return [path for stem in sorted(stems) if (path := newest(folder / stem)) is not None]


def newest(stem: Path) -> Path | None:
    """Return the newest picture with this path without suffix."""
    paths = [path for suffix in SUFFIXES if (path := stem.with_name(stem.name + suffix)).is_file()]
    return max(paths, key=lambda path: path.stat().st_mtime_ns, default=None)


def show(files: Sequence[Path], first: int, is_wanted: bool = True) -> bpy.types.Image:
    """Show frames in the Image Editors: as a sequence if their names count up, else the first of them.

    `first` is the scene's frame for the first file; `is_wanted` as in `editors.reveal`. Raises DataError if the first
    file is unreadable, BadRequest while Blender renders.
    """
    rendering.refuse()
    old = bpy.data.images.get(NAME)
    try:
        image = bpy.data.images.load(folders.stored(files[0]))
    except RuntimeError as error:
        raise DataError("{path} cannot be read as an image.", "Render the frames again.", path=files[0]) from error
    numbers = [number_of(path) for path in files]
    counts_up = None not in numbers and len({path.stem.rstrip("0123456789") for path in files}) == 1
    image.source = "SEQUENCE" if counts_up and len(files) > 1 else "FILE"
    if old is not None:
        old.user_remap(image)
        bpy.data.images.remove(old)
    image.name = NAME
    editors.reveal(image, is_wanted, is_whole=True)
    for area in windows.areas("IMAGE_EDITOR"):
        if area.spaces.active.image == image and image.source == "SEQUENCE":
            user = area.spaces.active.image_user
            user.frame_start, user.frame_offset = first, numbers[0] - 1
            user.frame_duration = numbers[-1] - numbers[0] + 1
            user.use_auto_refresh = True  # follow the scene's current frame
            editors.play(area)
    return image


def number_of(path: Path) -> int | None:
    """Return the number at the end of a file's name: Blender counts sequences by it."""
    match = re.search(r"\d+$", path.stem)
    return int(match[0]) if match else None


def add_strip(scene: bpy.types.Scene, files: Sequence[Path], first: int, name: str) -> "bpy.types.Strip":
    """Add frames of one folder to the scene's sequencer as a strip on the first free channel."""
    strips = compat.strips_of(scene)
    taken = {strip.channel for strip in strips if _overlaps(strip, first, first + len(files))}
    channel = next(number for number in range(1, len(taken) + 2) if number not in taken)
    strip = strips.new_image(
        name=name, filepath=folders.stored(files[0]), channel=channel, frame_start=first, fit_method="FIT"
    )
    for path in files[1:]:
        strip.elements.append(path.name)
    compat.show_in_sequencers(scene)
    return strip


def _overlaps(strip: "bpy.types.Strip", first: int, behind: int) -> bool:
    start, end = compat.strip_range(strip)
    return start < behind and first < end
