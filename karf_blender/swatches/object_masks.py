"""Where the objects are in a view, ready to be drawn."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np

from ..engine_api import Planes
from ..pictures import images, tints


@dataclass(frozen=True)
class ObjectMasks:
    """The objects of one view.

    Attributes:
        tints: The color of each object, by its name.
        fill: [H, W, 4] float32 sRGB and alpha, rows from the bottom: each object in its tint, as far as it covers.
        outlines: Ends of lines round the objects, [2n, 3] float32; the picture is 0..1 in x and y.
        colors: Of these ends, [2n, 4] float32.
        drawn: What the graphics card has of it, made at the first drawing.
    """

    tints: Mapping[str, tuple[float, float, float]]
    fill: np.ndarray
    outlines: np.ndarray
    colors: np.ndarray
    drawn: list = field(default_factory=list)


def numbers_of(scene: bpy.types.Scene) -> dict[str, int]:
    """The numbers of the colors of a scene's objects by their names, in the order of its list of objects to mark."""
    return {item.folder: item.number for item in scene.karf.marking.objects if item.number >= 0}


def in_order(scene: bpy.types.Scene, names: Iterable[str]) -> list[str]:
    """Names of objects in the order of the list of objects to mark; others follow."""
    listed = list(scene.karf.marking.objects.keys())
    return sorted(names, key=lambda name: listed.index(name) if name in listed else len(listed))


def of_planes(planes: Planes, scene: bpy.types.Scene) -> ObjectMasks:
    """A scene's objects in planes of any view or camera, of which there are some."""
    return paint(dict(zip(planes.objects, planes.probabilities.astype(np.float32), strict=True)), scene)


def of_files(files: Mapping[str, Path], scene: bpy.types.Scene) -> ObjectMasks | None:
    """A scene's objects in pictures of their masks, by name; None where there are no pictures.

    Raises:
        KarfError: One cannot be read.
    """
    return paint({name: images.read_picture(file)[..., 0] for name, file in files.items()}, scene) if files else None


def paint(coverages: Mapping[str, np.ndarray], scene: bpy.types.Scene) -> ObjectMasks:
    """A scene's objects as they are drawn. coverages: how far each covers every pixel, [H, W] in [0, 1]."""
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
    line_colors = [
        np.tile(np.float32((*colors[name], 1)), (len(ends), 1)) for name, ends in zip(names, lines, strict=True)
    ]
    return ObjectMasks(colors, np.ascontiguousarray(fill[::-1]), np.concatenate(lines), np.concatenate(line_colors))


def outline(mask: np.ndarray) -> np.ndarray:
    """Lines between the pixels of a mask [H, W] and all others: their ends [2n, 3], the picture 0..1, y up."""
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
