"""The colors of an object's swatches as arrays."""

import bpy
import numpy as np


def learned(item: bpy.types.PropertyGroup) -> np.ndarray:
    """An object's palette as learned, [M, 3] float32."""
    return stored(item, "learned")


def edited(item: bpy.types.PropertyGroup) -> np.ndarray:
    """An object's palette as edited, [M, 3] float32; black stays black."""
    colors = stored(item, "color")
    colors[:1] = learned(item)[:1]
    return colors


def stored(item: bpy.types.PropertyGroup, name: str) -> np.ndarray:
    """A color property of all swatches of an object, [M, 3] float32."""
    flat = np.empty(len(item.swatches) * 3, np.float32)
    item.swatches.foreach_get(name, flat)
    return flat.reshape(-1, 3)


def picked_with(item: bpy.types.PropertyGroup) -> np.ndarray:
    """The palette [M, 3] with which the picture showed the object's source color: the learned one before any was picked."""
    before = stored(item, "before")
    return before if before.any() else learned(item)
