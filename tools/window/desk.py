"""What the story asks of Blender and of the extension, on any version: pictures, keyframes, jobs. Runs inside Blender."""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np

PACKAGE = "bl_ext.user_default.karf"


def module(name: str):
    """A module of the enabled extension."""
    return sys.modules[f"{PACKAGE}.karf_blender.{name}"]


def scene() -> bpy.types.Scene:
    """The scene of the main window; a timer has no other context."""
    return bpy.data.window_managers[0].windows[0].scene


def picture() -> str:
    """The result picture's pixels as a short mark; empty where there is none."""
    image = scene().karf.result
    return "" if image is None else hashlib.sha1(_bytes(image).tobytes()).hexdigest()[:12]


def difference(before: np.ndarray) -> int:
    """Return by how much the bytes of the result picture differ at most from those that `pixels` returned before."""
    return int(np.abs(pixels().astype(int) - before).max())


def pixels() -> np.ndarray:
    """Return the bytes of the result picture, [H, W, 4]."""
    return _bytes(scene().karf.result)


def _bytes(image: bpy.types.Image) -> np.ndarray:
    buffer = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(buffer)
    return np.rint(buffer * 255).astype(np.uint8).reshape(image.size[1], image.size[0], 4)[::-1]


def is_in_step() -> bool:
    """Whether the result picture is what the swatches say."""
    wanted = module("pictures.images").upright(module("swatches.displayed").of(scene()).edited())
    shown = _bytes(scene().karf.result)[..., :3].astype(int)
    return bool(np.abs(shown - np.rint(np.clip(wanted, 0, 1) * 255)).max() <= 1)


def swatches() -> dict[str, list[tuple[float, ...]]]:
    """The colors of every object as they stand, rounded as a person would compare them."""
    return {
        item.name: [tuple(round(value, 4) for value in swatch.color) for swatch in item.swatches]
        for item in scene().karf.objects
    }


def middle_of(name: str) -> tuple[float, float]:
    """A place well on an object in the active view, in shares of the picture from the lower left."""
    planes = module("swatches.displayed").of(scene()).prepared_view().planes
    rows, columns = np.nonzero(planes.probabilities[planes.objects.index(name)] > 0.95)
    height, width = planes.base.shape[:2]
    nearest = np.hypot(rows - rows.mean(), columns - columns.mean()).argmin()
    return (columns[nearest] + 0.5) / width, 1 - (rows[nearest] + 0.5) / height


def curves() -> Iterator[bpy.types.FCurve]:
    """The animation curves of the scene; Blender 5 keeps them in layers."""
    data = scene().animation_data
    action = data.action if data else None
    if action is None:
        return
    if hasattr(action, "fcurves"):
        yield from action.fcurves
        return
    for layer in action.layers:
        for strip in layer.strips:
            for bag in strip.channelbags:
                yield from bag.fcurves


def animated_objects() -> set[str]:
    """The names of the objects whose swatches have keyframes."""
    found = set()
    for curve in curves():
        owner = re.match(r"karf\.objects\[[^\]]+\]", curve.data_path)
        if owner:
            try:
                found.add(scene().path_resolve(owner.group()).name)
            except ValueError:
                found.add(f"nothing ({curve.data_path})")
    return found


def mask(name: str) -> bytes:
    """An object's mask of the active view, as its file holds it."""
    folder = module("marking.objects").masks_folder(scene())
    return (folder / name / f"{scene().karf.active_view}.png").read_bytes()


def pixels_of(file: Path) -> np.ndarray:
    """A picture file's pixels [H, W, 3], as its numbers are."""
    image = bpy.data.images.load(str(file))
    try:
        return _bytes(image)[..., :3].astype(int)
    finally:
        bpy.data.images.remove(image)


def output() -> Path:
    """The folder that pictures go to."""
    return module("project.folders").out_folder(scene())


def photo_of(view: str) -> Path:
    """A captured view's photo."""
    return module("project.captures").view_of(scene(), view).image
