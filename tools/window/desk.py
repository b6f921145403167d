"""Questions to Blender and the extension: pictures, swatches, keyframes, stages. Runs inside Blender."""

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
MARKED_VIEW, PHOTO_SIZE = "r_041", 512


class Broken(Exception):
    """A step's promise does not hold."""


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
    """Return a module of the enabled extension."""
    return sys.modules[f"{PACKAGE}.karf_blender.{name}"]


def scene() -> bpy.types.Scene:
    """Return the main window's scene; a timer has no other context."""
    return hands.window().scene


# --- pictures --------------------------------------------------------------------------------------------------------
def pixels() -> np.ndarray:
    """Return the result picture's bytes, [H, W, 3]."""
    return _bytes(scene().karf.result)


def picture() -> str:
    """Return a short hash of the result picture's pixels."""
    return hashlib.sha1(pixels().tobytes()).hexdigest()[:12]


def pixels_of(file: Path) -> np.ndarray:
    """Return a picture file's bytes, [H, W, 3]."""
    image = bpy.data.images.load(str(file))
    try:
        return _bytes(image)
    finally:
        bpy.data.images.remove(image)


def _bytes(image: bpy.types.Image) -> np.ndarray:
    buffer = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(buffer)
    return np.rint(buffer * 255).astype(np.uint8).reshape(image.size[1], image.size[0], 4)[::-1, :, :3]


def mask_file() -> Path:
    """Return the file of the object's mask in the active view."""
    folder = module("marking.objects").masks_folder(scene()) / scene().karf.marking.objects[0].name
    return folder / f"{scene().karf.active_view}.png"


def mask() -> np.ndarray:
    """Return the object's mask of the active view from its file, [H, W]."""
    return pixels_of(mask_file())[..., 0]


def difference(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return by how much bytes differ."""
    return np.abs(one.astype(int) - other)


def is_in_step() -> bool:
    """Return whether the result picture shows the colors of the swatches."""
    wanted = module("pictures.images").upright(module("swatches.displayed").of(scene()).edited())
    return difference(pixels(), np.rint(np.clip(wanted, 0, 1) * 255)).max() <= 1


# --- swatches --------------------------------------------------------------------------------------------------------
def swatches() -> list[tuple[float, ...]]:
    """Return the object's current colors, rounded."""
    return [tuple(round(value, 4) for value in swatch.color) for swatch in scene().karf.objects[0].swatches]


def middle_of_object() -> tuple[float, float]:
    """Return a place well inside the object in the active view, in shares of the picture from the lower left."""
    planes = module("swatches.displayed").of(scene()).prepared_view().planes
    rows, columns = np.nonzero(planes.probabilities[0] > 0.95)
    height, width = planes.base.shape[:2]
    nearest = np.hypot(rows - rows.mean(), columns - columns.mean()).argmin()
    return (columns[nearest] + 0.5) / width, 1 - (rows[nearest] + 0.5) / height


def keyframes() -> set[tuple[str, float, float]]:
    """Return the scene's keyframes: data path, frame and value."""
    data = scene().animation_data
    curves = module("host.compat").curves_of(data) if data else []
    return {(curve.data_path, point.co.x, round(point.co.y, 4)) for curve in curves for point in curve.keyframe_points}


# --- the project ---------------------------------------------------------------------------------------------------
def stages() -> set[str]:
    """Return the project's finished stages."""
    return module("project.disk").read(scene()).stages
