"""Objects and palette weights of Gaussians, and edits of their colors.

F_s at its center gives a Gaussian's object, its constant color the palette weights. The derivative of these weights
carries an edit to the higher harmonics, so that shading and highlights take the new hue too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from ..fields.scene import Scene
from ..heads.fields import SegmentationField
from ..heads.rendering import NEGLIGIBLE
from ..palettes.added import extended_palettes, split_weights
from ..palettes.palette import AddedColor, Edit, Palette
from ..palettes.palette_weights import star_weights
from ..splats.gaussians import Gaussians
from ..splats.kernels.arrays import C0, COLOR

if TYPE_CHECKING:
    from ..splats.rasterizer import RasterizedView  # needs numba

WEIGHT = "karf_weight_"  # prefix of columns in files, before the number of the palette's color
STEP = 0.01  # of the central differences of the weights, sRGB
POINTS_PER_CHUNK = 1 << 16


@dataclass(frozen=True)
class ObjectSplats:
    """The m Gaussians of one object.

    Attributes:
        rows: [m] of the table.
        shares: [m] float32 in (0, 1], probabilities of the object.
        weights: [m, M] float32 >= 0, over the palette with its sets of added colors; rows sum to 1.
        slopes: [m, M, 3] float32, derivatives of the weights by the color.
    """

    rows: np.ndarray
    shares: np.ndarray
    weights: np.ndarray
    slopes: np.ndarray


@torch.no_grad()
def shares_of_objects(gaussians: Gaussians, segmentation: SegmentationField, scene: Scene) -> np.ndarray:
    """Evaluate F_s at the Gaussians' centers: object probabilities [n, K] float32, 0 for the background's Gaussians."""
    field, boxes = scene.field, segmentation.boxes
    assert isinstance(boxes, torch.Tensor)
    shares = np.zeros((len(gaussians), len(boxes)), np.float32)
    for first in range(0, gaussians.n_foreground, POINTS_PER_CHUNK):
        rows = slice(first, min(first + POINTS_PER_CHUNK, gaussians.n_foreground))
        world = torch.from_numpy(gaussians.table[rows, :3]).to(field.bounds.device)
        positions = field.space.to_grid(world).float()
        inside = segmentation.inside(positions).any(1)
        positions = positions[inside]
        classes = segmentation(positions, field.features(positions))[:, 1:]
        shares[rows][inside.cpu().numpy()] = classes.cpu().numpy()
    return shares


def splats_of_objects(
    gaussians: Gaussians, shares: np.ndarray, palettes: Sequence[Palette], added: Mapping[str, Sequence[AddedColor]]
) -> tuple[ObjectSplats, ...]:
    """Return the Gaussians of each of K objects with their palette weights.

    shares: [n, K], see `shares_of_objects`. added: added colors by the objects' names.
    """
    colors = np.clip(0.5 + C0 * gaussians.table[:, COLOR : COLOR + 3], 0, 1)
    result = []
    for own, palette in zip(shares.T, palettes, strict=True):
        rows = np.flatnonzero(own > NEGLIGIBLE)

        def weights_of(some: np.ndarray, palette: Palette = palette) -> np.ndarray:
            weights = star_weights(some, palette.colors)
            return (
                split_weights(weights.T, palette.colors, added[palette.name]).T if added.get(palette.name) else weights
            )

        steps = STEP * np.eye(3, dtype=np.float32)
        slopes = [(weights_of(colors[rows] + s) - weights_of(colors[rows] - s)) / (2 * STEP) for s in steps]
        result.append(ObjectSplats(rows, own[rows], weights_of(colors[rows]), np.stack(slopes, -1)))
    return tuple(result)


def bake_edit(
    gaussians: Gaussians, objects: Sequence[ObjectSplats], palettes: Sequence[Palette], edit: Edit
) -> Gaussians:
    """Bake an additive (`delta`) edit into the colors of Gaussians; unaffected ones keep their bits.

    objects: of these Gaussians, with the edit's added colors. palettes: as learned.
    """
    table = gaussians.table.copy()
    for own, palette in zip(objects, extended_palettes(palettes, edit.added), strict=True):
        change = (edit.colors[palette.name] - palette.colors).astype(np.float32)
        if not change.any():
            continue
        harmonics = table[own.rows, COLOR:].reshape(len(own.rows), -1, 3)
        by_color = np.einsum("nmi,mj->nij", own.slopes, change)
        changes = np.concatenate([(own.weights @ change / C0)[:, None], harmonics[:, 1:] @ by_color], 1)
        table[own.rows, COLOR:] = (harmonics + own.shares[:, None, None] * changes).reshape(len(own.rows), -1)
    return replace(gaussians, table=table)


def columns_of(shares: np.ndarray, objects: Sequence[ObjectSplats]) -> dict[str, np.ndarray]:
    """Return object and palette weights of each Gaussian as columns of a file.

    Returns:
        `karf_object`, [n] uint8: 0 for none, else the number of the most probable object from 1; `karf_probability`, [n]
        float32, of that object; `karf_weight_0` and so on, [n] float32, its palette weights, padded with 0.
    """
    best = shares.argmax(1)
    probability = np.take_along_axis(shares, best[:, None], 1)[:, 0]
    is_object = probability > 0.5
    weights = np.zeros((len(shares), max(own.weights.shape[1] for own in objects)), np.float32)
    for number, own in enumerate(objects):
        mine = is_object[own.rows] & (best[own.rows] == number)
        weights[own.rows[mine], : own.weights.shape[1]] = own.weights[mine]
    columns = {"karf_object": np.where(is_object, best + 1, 0).astype(np.uint8), "karf_probability": probability}
    return columns | {f"{WEIGHT}{number}": column.copy() for number, column in enumerate(weights.T)}


def render_planes(
    view: RasterizedView, gaussians: Gaussians, objects: Sequence[ObjectSplats]
) -> tuple[np.ndarray, np.ndarray]:
    """Render the objects of a view of these Gaussians.

    Returns:
        Probabilities [K, H, W] float32 in [0, 1], and palette weights [K, M, H, W] times these; M is that of the largest
        palette.
    """
    n_colors = max((own.weights.shape[1] for own in objects), default=0)
    values = np.zeros((len(gaussians), len(objects), 1 + n_colors), np.float32)
    constant, seen = 0.5 + C0 * gaussians.table[:, COLOR : COLOR + 3], view.colors
    for number, own in enumerate(objects):
        weights = own.weights + np.einsum("nmc,nc->nm", own.slopes, (seen - constant)[own.rows])
        weights = np.maximum(weights, 0)
        weights /= weights.sum(1, keepdims=True)
        values[own.rows, number, 0] = own.shares
        values[own.rows, number, 1 : 1 + weights.shape[1]] = own.shares[:, None] * weights
    planes = view.blended(values.reshape(len(gaussians), -1)).reshape(len(objects), 1 + n_colors, *view.image.shape[:2])
    return planes[:, 0], planes[:, 1:]
