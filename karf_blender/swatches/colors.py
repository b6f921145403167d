"""The colors of an object's swatches as arrays."""

import bpy
import numpy as np


def learned(item: bpy.types.PropertyGroup) -> np.ndarray:
    """An object's palette as learned, [M, 3] float32."""
    return _colors(item, "learned")


def edited(item: bpy.types.PropertyGroup) -> np.ndarray:
    """An object's palette as edited, [M, 3] float32; black stays black."""
    colors = _colors(item, "color")
    colors[:1] = learned(item)[:1]
    return colors


def _colors(item: bpy.types.PropertyGroup, name: str) -> np.ndarray:
    flat = np.empty(len(item.swatches) * 3, np.float32)
    item.swatches.foreach_get(name, flat)
    return flat.reshape(-1, 3)
