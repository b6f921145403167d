"""Masks of the objects in a view, ready to be drawn."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np

from ..engine_api import Planes
from ..pictures import images, tints


@dataclass(frozen=True)
class ObjectMasks:
    """The objects of one view, each in its tint."""

    tints: Mapping[str, tuple[float, float, float]]  # by object
    fill: np.ndarray  # [H, W, 4] float32 sRGB and coverage, rows from the bottom
    outlines: np.ndarray  # ends of lines, [2n, 3] float32; the picture is 0..1 in x and y
    colors: np.ndarray  # of these ends, [2n, 4] float32
    drawn: list = field(default_factory=list)  # what the graphics card has of it


def numbers_of(scene: bpy.types.Scene) -> dict[str, int]:
    """Return the numbers of the tints of a scene's objects, by name."""
    return {item.folder: item.number for item in scene.karf.marking.objects if item.number >= 0}


def in_order(scene: bpy.types.Scene, names: Iterable[str]) -> list[str]:
    """Sort names of objects as the list of objects to mark has them; others follow."""
    listed = list(scene.karf.marking.objects.keys())
    return sorted(names, key=lambda name: listed.index(name) if name in listed else len(listed))


def of_planes(planes: Planes, scene: bpy.types.Scene) -> ObjectMasks:
    """Return a scene's objects in planes, which have some."""
    return _paint(dict(zip(planes.objects, planes.probabilities.astype(np.float32), strict=True)), scene)


def of_files(files: Mapping[str, Path], scene: bpy.types.Scene) -> ObjectMasks | None:
    """Return a scene's objects in pictures of their masks, by name; None without any. Raises KarfError if unreadable."""
    return _paint({name: images.read_picture(file)[..., 0] for name, file in files.items()}, scene) if files else None


def _paint(coverages: Mapping[str, np.ndarray], scene: bpy.types.Scene) -> ObjectMasks:
    """Return the masks of objects that cover every pixel this far, [H, W] in [0, 1] each."""
    names = in_order(scene, sorted(coverages))
    colors = tints.tints_of(names, numbers_of(scene))
    height, width = next(iter(coverages.values())).shape
    fill = np.zeros((height, width, 4), np.float32)
    for name in names:
        fill[..., :3] += coverages[name][..., None] * np.float32(colors[name])
        fill[..., 3] += coverages[name]
    fill[..., :3] /= np.maximum(fill[..., 3:], 1e-6)
    fill[..., 3] = fill[..., 3].clip(0, 1)
    lines = [outline(coverages[name] > 0.5) for name in names]
    line_colors = np.float32([(*colors[name], 1) for name in names]).repeat([len(ends) for ends in lines], axis=0)
    return ObjectMasks(colors, np.ascontiguousarray(fill[::-1]), np.concatenate(lines), line_colors)


def outline(mask: np.ndarray) -> np.ndarray:
    """Return the ends [2n, 3] of lines between the pixels of a mask [H, W] and all others, the picture 0..1, y up."""
    padded = np.pad(mask, 1)
    y, x = np.nonzero(padded[:, 1:] != padded[:, :-1])
    upright = np.stack([x, y - 1, x, y], axis=-1)
    y, x = np.nonzero(padded[1:] != padded[:-1])
    level = np.stack([x - 1, y, x, y], axis=-1)
    ends = np.concatenate([upright, level]).reshape(-1, 2)
    result = np.zeros((len(ends), 3), np.float32)
    result[:, :2] = ends / np.array(mask.shape[::-1])
    result[:, 1] = 1 - result[:, 1]
    return result
