"""Labels: lines of text in Blender's own font and plain areas, drawn in inks, as one picture that materials look up.

Naming: label units are scene units on the unrolled surface, u to the right and v up, (0, 0) in the label's middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from PIL import Image, ImageDraw

INKS = ("colored", "dark", "foil")  # the channels of a label's picture; what is printed in "paper" is left out of all
FINENESS = 768  # pixels of a label's picture in one scene unit
SUBPIXELS = 3  # along a pixel's side, while drawing
CAPITALS = 0.682  # height of the font's capitals at its size 1


@dataclass(frozen=True)
class Text:
    """A line of text, its middle at (u, v); ``height``: of its capitals; ``lean``: 0 is upright; ``bold``: how much
    wider than the font's its strokes are on either side, as a share of the height."""

    body: str
    u: float
    v: float
    height: float
    ink: str = "colored"
    lean: float = 0.0
    bold: float = 0.02


@dataclass(frozen=True)
class Area:
    """A plain rectangle from (u, v) to the right and up."""

    u: float
    v: float
    width: float
    height: float
    ink: str = "colored"


@dataclass(frozen=True)
class Label:
    """What is printed on a surface of this size; later marks cover earlier ones."""

    width: float
    height: float
    marks: tuple[Text | Area, ...]


def bars(u: float, v: float, width: float, height: float, ink: str = "dark") -> tuple[Area, ...]:
    """Return a bar code from (u, v) to the right and up; the same code every time."""
    edges = np.cumsum(np.random.default_rng(5).integers(1, 4, 41))
    edges = u + width * (edges - edges[0]) / (edges[-1] - edges[0])
    return tuple(Area(a, v, b - a, height, ink) for a, b in zip(edges[::2], edges[1::2], strict=False))


def draw_label(label: Label) -> np.ndarray:
    """Return how much of each pixel each ink covers: float32 [H, W, 3] in [0, 1], the top row first."""
    size = tuple(round(length * FINENESS) for length in (label.width, label.height))
    inks = np.zeros((size[1], size[0], len(INKS)), np.float32)
    for mark in label.marks:
        covered = _coverage(_triangles(mark), label, size)
        inks *= 1 - covered[..., None]
        if mark.ink != "paper":
            inks[..., INKS.index(mark.ink)] += covered
    return inks


def label_image(name: str, label: Label) -> bpy.types.Image:
    """Return the label as a new image of Blender, held in memory, its channels the inks."""
    inks = draw_label(label)
    height, width = inks.shape[:2]
    image = bpy.data.images.new(name, width, height, float_buffer=True, is_data=True)
    opaque = np.concatenate([inks, np.ones((height, width, 1), np.float32)], 2)
    image.pixels.foreach_set(np.ascontiguousarray(opaque[::-1]).ravel())
    image.pack()
    return image


def _coverage(triangles: np.ndarray, label: Label, size: tuple[int, int]) -> np.ndarray:
    """Return how much of each pixel triangles [n, 3, 2] in label units cover, [H, W] in [0, 1]."""
    scale = FINENESS * SUBPIXELS
    corners = (triangles + (0.5 * label.width, -0.5 * label.height)) * (scale, -scale)
    canvas = Image.new("L", (size[0] * SUBPIXELS, size[1] * SUBPIXELS))
    draw = ImageDraw.Draw(canvas)
    for triangle in corners:
        draw.polygon([tuple(corner) for corner in triangle], fill=255)
    return np.asarray(canvas.reduce(SUBPIXELS), np.float32) / 255


def _triangles(mark: Text | Area) -> np.ndarray:
    """Return a mark's surface as triangles [n, 3, 2] in label units."""
    if isinstance(mark, Text):
        return _text_triangles(mark)
    u, v, right, top = mark.u, mark.v, mark.u + mark.width, mark.v + mark.height
    return np.array([[(u, v), (right, v), (right, top)], [(u, v), (right, top), (u, top)]])


def _text_triangles(text: Text) -> np.ndarray:
    """Return a line of text as triangles [n, 3, 2] in label units."""
    curve = bpy.data.curves.new("text", "FONT")
    curve.body, curve.shear, curve.offset = text.body, text.lean, text.bold * CAPITALS
    drawn = bpy.data.objects.new("text", curve)
    mesh = bpy.data.meshes.new_from_object(drawn)
    mesh.calc_loop_triangles()
    corners = np.array([mesh.vertices[i].co[:2] for triangle in mesh.loop_triangles for i in triangle.vertices])
    bpy.data.meshes.remove(mesh)
    bpy.data.objects.remove(drawn)
    bpy.data.curves.remove(curve)
    middle = 0.5 * (corners[:, 0].min() + corners[:, 0].max()), 0.5 * CAPITALS
    return ((corners - middle) * (text.height / CAPITALS) + (text.u, text.v)).reshape(-1, 3, 2)
