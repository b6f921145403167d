"""The scene as Gaussians: frames of any camera, and edits in the Gaussians' colors.

F_s at its center gives a Gaussian's object, its constant color the palette weights. The derivative of these weights
carries an edit to the higher harmonics, so that shading and highlights take the new hue too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import View
from ..fields.scene import Picture, Scene
from ..heads.fields import SegmentationField
from ..heads.rendering import NEGLIGIBLE
from ..palettes.added import extended_palettes, split_weights
from ..palettes.edge_shape import MAX_EDGE_REACH, Borders, EdgeShape, active_edges, apply_edges_to_points
from ..palettes.palette import AddedColor, Edit, Palette
from ..palettes.palette_weights import star_weights
from ..splats.gaussians import Gaussians
from ..splats.kernels.arrays import C0, COLOR
from ..splats.rasterizer import rasterize
from ..splats.view import RasterizedView
from ..splats.visibility import confidence_from
from .borders import measure_borders
from .frames import Frame

WEIGHT = "karf_weight_"  # prefix of columns in files, before the number of the palette's color
STEP = 0.01  # of the central differences of the weights, sRGB
POINTS_PER_CHUNK = 1 << 16
OPACITY = 10  # column of a table of Gaussians
MIN_LOGIT = -2.0  # of the opacity of Gaussians that form a border: 12 %


@dataclass(frozen=True)
class ObjectSplats:
    """The m Gaussians of one object."""

    rows: np.ndarray  # [m] of the table
    shares: np.ndarray  # [m] float32 in (0, 1], probabilities of the object
    weights: np.ndarray  # [m, M] float32 >= 0, over the palette with its sets of added colors; rows sum to 1
    slopes: np.ndarray  # [m, M, 3] float32, derivatives of the weights by the color


class SplattedScene:
    """A model's Gaussians, with their objects and palette weights."""

    def __init__(
        self,
        gaussians: Gaussians,
        scene: Scene,  # the field that F_s was learned on
        segmentation: SegmentationField | None,
        palettes: Sequence[Palette],  # of the K objects, as learned; empty before palettes are learned
        views: Callable[[], Sequence[View]],  # of the capture, when edges are first moved
        fades: bool,  # whether colors that no photo shows fade to gray, unless a call says otherwise
    ) -> None:
        self.gaussians = gaussians
        self._scene, self._segmentation, self._palettes, self._views = scene, segmentation, palettes, views
        self.fade_unseen = fades
        # the last results, by their arguments
        self._baked: tuple[Any, Gaussians] | None = None
        self._reachable: tuple[str, tuple[ObjectSplats, ...]] | None = None
        self._edged: tuple[tuple[str, str], tuple[ObjectSplats, ...]] | None = None

    @cached_property
    def shares(self) -> np.ndarray:
        """Object probabilities of each Gaussian, [n, K]."""
        if self._segmentation is None:
            return np.zeros((len(self.gaussians), 0), np.float32)
        return shares_of_objects(self.gaussians, self._segmentation, self._scene)

    @cached_property
    def objects(self) -> tuple[ObjectSplats, ...]:
        """The Gaussians of each object with their palette weights."""
        return splats_of_objects(self.gaussians, self.shares, self._palettes, {})

    @cached_property
    def _borders(self) -> Borders:
        solid = self.gaussians.table[: self.gaussians.n_foreground]
        near = measure_borders(solid[:, :3], self.shares[: len(solid)], solid[:, OPACITY] > MIN_LOGIT, self._views())
        distances = np.full(self.shares.shape, -np.inf, np.float32)
        distances[: len(solid)] = near.distances
        return replace(near, distances=distances)

    def _edged_objects(
        self, edges: Mapping[str, EdgeShape], added: Mapping[str, Sequence[AddedColor]]
    ) -> tuple[ObjectSplats, ...]:
        """Return the Gaussians of each object with these edges and added colors, both by object."""
        key = repr(active_edges(edges)), repr(added)
        if self._edged is None or self._edged[0] != key:
            names = [palette.name for palette in self._palettes]
            shares = apply_edges_to_points(self.shares, self._borders, names, edges)
            self._edged = key, tuple(_within(own, shares[:, k]) for k, own in enumerate(self._reachable_objects(added)))
        return self._edged[1]

    def _reachable_objects(self, added: Mapping[str, Sequence[AddedColor]]) -> tuple[ObjectSplats, ...]:
        """Return the Gaussians that each object could cover with any edge."""
        if self._reachable is None or self._reachable[0] != repr(added):
            is_near = self._borders.distances > -MAX_EDGE_REACH * self._borders.pixels
            reached = np.maximum(self.shares, np.where(is_near, 2 * NEGLIGIBLE, 0))
            self._reachable = repr(added), splats_of_objects(self.gaussians, reached, self._palettes, added)
        return self._reachable[1]

    def frame(self, camera: Camera, edges: Mapping[str, EdgeShape] | None = None, fades: bool | None = None) -> Frame:
        """Render a pinhole, with edges of these objects moved; without palette weights before palettes are learned."""
        fades = self.fade_unseen if fades is None else fades
        visibility = self._visibility(camera)
        view = self._rasterize(self.gaussians, camera, visibility if fades else None)
        is_solid = np.arange(len(self.gaussians)) < self.gaussians.n_foreground
        opacity, depth, seen = view.blended(np.stack([is_solid, np.where(is_solid, view.depths, 0), visibility], 1))
        depth = np.divide(depth, opacity, out=np.zeros_like(depth), where=opacity > 0)
        color = view.picture()
        if self.gaussians.n_background == 0:
            seen += view.image[..., 3]  # transmittance: an empty background is known
        picture = Picture(torch.from_numpy(color), torch.from_numpy(opacity), torch.from_numpy(depth), None)
        if not self._palettes:
            return Frame(picture, view.blended(self.shares), None, color, visibility=seen)
        objects = self._edged_objects(edges, {}) if edges else self.objects
        if fades:
            objects = tuple(replace(own, shares=own.shares * visibility[own.rows]) for own in objects)
        return Frame(picture, *render_planes(view, self.gaussians, objects), color, visibility=seen)

    def render_recolored(self, camera: Camera, edit: Edit, fades: bool | None = None) -> np.ndarray:
        """Render a pinhole with an additive edit, [H, W, 3] float32 sRGB in [0, 1]."""
        fades = self.fade_unseen if fades is None else fades
        return self._rasterize(self.recolored(edit), camera, self._visibility(camera) if fades else None).picture()

    def _rasterize(self, gaussians: Gaussians, camera: Camera, sure: np.ndarray | None = None) -> RasterizedView:
        return rasterize(gaussians, camera, sure, self._scene.field.bounds.device)

    def _visibility(self, camera: Camera) -> np.ndarray:
        """Return how well photos cover each Gaussian's color from this position, [n] float32 in [0, 1]; 1 if unknown."""
        if self.gaussians.visibility is None:
            return np.ones(len(self.gaussians), np.float32)
        return confidence_from(self.gaussians, camera.position)

    def recolored(self, edit: Edit) -> Gaussians:
        """Bake an additive edit into the Gaussians' colors. The last result is kept. Edges are lengths, see `borders`."""
        edges, colors = active_edges(edit.edges), {name: colors.tobytes() for name, colors in edit.colors.items()}
        key = repr(edit.added), repr(edges), colors
        if self._baked is None or self._baked[0] != key:
            self._baked = key, bake_edit(self.gaussians, self.objects_of(edit), self._palettes, edit)
        return self._baked[1]

    def objects_of(self, edit: Edit) -> tuple[ObjectSplats, ...]:
        """Return the Gaussians of each object with the weights of an edit's added colors, within its edges."""
        edges = active_edges(edit.edges)
        if edges:
            return self._edged_objects(edges, edit.added)
        if any(edit.added.values()):
            return splats_of_objects(self.gaussians, self.shares, self._palettes, edit.added)
        return self.objects

    def render_background(self, pinhole: Camera) -> np.ndarray:
        """Render the Gaussians of the background alone, [H, W, 3] float32 sRGB."""
        shell = replace(self.gaussians, table=self.gaussians.table[self.gaussians.n_foreground :], visibility=None)
        return self._rasterize(shell, pinhole).picture()


def _within(reachable: ObjectSplats, shares: np.ndarray) -> ObjectSplats:
    own = shares[reachable.rows]
    kept = own > NEGLIGIBLE
    return ObjectSplats(reachable.rows[kept], own[kept], reachable.weights[kept], reachable.slopes[kept])


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
    """Return the Gaussians of each of K objects with their palette weights. shares: [n, K], of `shares_of_objects`."""
    colors = np.clip(0.5 + C0 * gaussians.table[:, COLOR : COLOR + 3], 0, 1)
    result = []
    for own, palette in zip(shares.T, palettes, strict=True):
        rows = np.flatnonzero(own > NEGLIGIBLE)

        def weights_of(some: np.ndarray, palette: Palette = palette) -> np.ndarray:
            weights, own_added = star_weights(some, palette.colors), added.get(palette.name)
            return split_weights(weights.T, palette.colors, own_added).T if own_added else weights

        steps = STEP * np.eye(3, dtype=np.float32)
        slopes = [(weights_of(colors[rows] + s) - weights_of(colors[rows] - s)) / (2 * STEP) for s in steps]
        result.append(ObjectSplats(rows, own[rows], weights_of(colors[rows]), np.stack(slopes, -1)))
    return tuple(result)


def bake_edit(
    gaussians: Gaussians, objects: Sequence[ObjectSplats], palettes: Sequence[Palette], edit: Edit
) -> Gaussians:
    """Bake an additive (`delta`) edit into the colors of Gaussians, whose objects have the edit's added colors.

    Unaffected Gaussians keep their bits.
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
    """Return columns of a file: each Gaussian's object (from 1; 0 for none), its probability and palette weights."""
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
    """Render probabilities [K, H, W] float32 in [0, 1], and palette weights [K, M, H, W] times these, of a view."""
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
