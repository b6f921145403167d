"""What the story asks of Blender and of the extension: pictures, swatches, keyframes, stages. Runs inside Blender."""

from __future__ import annotations

import hashlib
import sys
import time
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np

from . import hands
from .hands import Wait

PACKAGE = "bl_ext.user_default.karf"
MARKED_VIEW, PHOTO_SIZE = "r_041", 256


class Broken(Exception):
    """What a step promises does not hold."""


def check(holds: bool, sentence: str) -> None:
    """Raise Broken with the sentence where something does not hold."""
    if not holds:
        raise Broken(sentence)


def until(condition: Callable[[], object], what: str, seconds: float = 10) -> Wait:
    """Wait for something; Broken where it does not come."""
    end = time.monotonic() + seconds
    while not condition():
        check(time.monotonic() < end, f"{what} did not come within {seconds:.0f} s")
        yield 0.1


def module(name: str):
    """A module of the enabled extension."""
    return sys.modules[f"{PACKAGE}.karf_blender.{name}"]


def scene() -> bpy.types.Scene:
    """The scene of the main window; a timer has no other context."""
    return hands.window().scene


# --- pictures --------------------------------------------------------------------------------------------------------
def pixels() -> np.ndarray:
    """The result picture's bytes [H, W, 3]."""
    return _bytes(scene().karf.result)


def picture() -> str:
    """The result picture's pixels as a short mark."""
    return hashlib.sha1(pixels().tobytes()).hexdigest()[:12]


def pixels_of(file: Path) -> np.ndarray:
    """A picture file's bytes [H, W, 3]."""
    image = bpy.data.images.load(str(file))
    try:
        return _bytes(image)
    finally:
        bpy.data.images.remove(image)


def _bytes(image: bpy.types.Image) -> np.ndarray:
    buffer = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(buffer)
    return np.rint(buffer * 255).astype(np.uint8).reshape(image.size[1], image.size[0], 4)[::-1, :, :3]


def mask() -> np.ndarray:
    """The object's mask of the active view, as its file holds it, [H, W]."""
    folder = module("marking.objects").masks_folder(scene()) / scene().karf.marking.objects[0].name
    return pixels_of(folder / f"{scene().karf.active_view}.png")[..., 0]


def difference(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """By how much bytes differ."""
    return np.abs(one.astype(int) - other)


def is_in_step() -> bool:
    """Whether the result picture is what the swatches say."""
    wanted = module("pictures.images").upright(module("swatches.displayed").of(scene()).edited())
    return difference(pixels(), np.rint(np.clip(wanted, 0, 1) * 255)).max() <= 1


# --- swatches --------------------------------------------------------------------------------------------------------
def swatches() -> list[tuple[float, ...]]:
    """The colors of the object as they stand, rounded as a person would compare them."""
    return [tuple(round(value, 4) for value in swatch.color) for swatch in scene().karf.objects[0].swatches]


def middle_of_object() -> tuple[float, float]:
    """A place well on the object in the active view, in shares of the picture from the lower left."""
    planes = module("swatches.displayed").of(scene()).prepared_view().planes
    rows, columns = np.nonzero(planes.probabilities[0] > 0.95)
    height, width = planes.base.shape[:2]
    nearest = np.hypot(rows - rows.mean(), columns - columns.mean()).argmin()
    return (columns[nearest] + 0.5) / width, 1 - (rows[nearest] + 0.5) / height


def keyframes() -> set[tuple[str, float, float]]:
    """The keyframes of the scene: what they animate, the frame and the value."""
    data = scene().animation_data
    curves = module("host.compat").curves_of(data) if data else []
    return {(curve.data_path, point.co.x, round(point.co.y, 4)) for curve in curves for point in curve.keyframe_points}


# --- the project ---------------------------------------------------------------------------------------------------
def stages() -> set[str]:
    """The stages of the project that are done."""
    return module("project.disk").read(scene()).stages
