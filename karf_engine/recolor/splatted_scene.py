"""The scene as Gaussians: frames of any camera, and edits in the Gaussians' colors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import View
from ..fields.scene import Picture, Scene
from ..heads.fields import SegmentationField
from ..palettes.edge_shape import EdgeShape, active_edges
from ..palettes.palette import Edit, Palette
from ..splats.gaussians import Gaussians
from .borders import EdgedSplats
from .frames import Frame
from .splat_colors import ObjectSplats, bake_edit, render_planes, shares_of_objects, splats_of_objects

if TYPE_CHECKING:
    from ..splats.rasterizer import RasterizedView  # needs numba


class SplattedScene:
    """A model's Gaussians, with their objects and palette weights.

    Args:
        gaussians: As learned.
        scene: The field that F_s was learned on.
        segmentation: F_s, or None before segmentation.
        palettes: Of the K objects, as learned; empty before palettes are learned.
        views: Returns the views of the capture, when edges are first moved.
        fades: Whether colors that no photo shows fade to gray, unless a call says otherwise.
    """

    def __init__(
        self,
        gaussians: Gaussians,
        scene: Scene,
        segmentation: SegmentationField | None,
        palettes: Sequence[Palette],
        views: Callable[[], Sequence[View]],
        fades: bool,
    ) -> None:
        self.gaussians = gaussians
        self._scene, self._segmentation, self._palettes, self._views = scene, segmentation, palettes, views
        self.fade_unseen = fades
        self._baked: tuple[Any, Gaussians] | None = None  # the last edit, and its result

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
    def _edged(self) -> EdgedSplats:
        return EdgedSplats(self.gaussians, self.shares, self._palettes, self._views())

    def frame(self, camera: Camera, edges: Mapping[str, EdgeShape] | None = None, fades: bool | None = None) -> Frame:
        """Render a pinhole, with edges of these objects moved; without palette weights before palettes are learned."""
        fades = self.fade_unseen if fades is None else fades
        visibility = self._visibility(camera)
        view = rasterize(self.gaussians, camera, visibility if fades else None)
        is_solid = np.arange(len(self.gaussians)) < self.gaussians.n_foreground
        opacity, depth, seen = view.blended(np.stack([is_solid, np.where(is_solid, view.depths, 0), visibility], 1))
        depth = np.divide(depth, opacity, out=np.zeros_like(depth), where=opacity > 0)
        color = view.picture()
        if self.gaussians.n_background == 0:
            seen += view.image[..., 3]  # transmittance: an empty background is known
        picture = Picture(torch.from_numpy(color), torch.from_numpy(opacity), torch.from_numpy(depth), None)
        if not self._palettes:
            return Frame(picture, view.blended(self.shares), None, color, visibility=seen)
        objects = self._edged.objects(edges, {}) if edges else self.objects
        if fades:
            objects = tuple(replace(own, shares=own.shares * visibility[own.rows]) for own in objects)
        return Frame(picture, *render_planes(view, self.gaussians, objects), color, visibility=seen)

    def render_recolored(self, camera: Camera, edit: Edit, fades: bool | None = None) -> np.ndarray:
        """Render a pinhole with an additive edit, [H, W, 3] float32 sRGB in [0, 1]."""
        fades = self.fade_unseen if fades is None else fades
        return rasterize(self.recolored(edit), camera, self._visibility(camera) if fades else None).picture()

    def _visibility(self, camera: Camera) -> np.ndarray:
        """How well photos cover each Gaussian's color from this position, [n] float32 in [0, 1]; 1 if unknown."""
        if self.gaussians.visibility is None:
            return np.ones(len(self.gaussians), np.float32)
        from ..splats.visibility import confidence_from  # needs numba

        return confidence_from(self.gaussians, camera.position)

    def recolored(self, edit: Edit) -> Gaussians:
        """Bake an additive edit into the Gaussians' colors. The last result is kept. Edges are lengths, see `borders`."""
        edges, colors = active_edges(edit.edges), {name: colors.tobytes() for name, colors in edit.colors.items()}
        key = repr(edit.added), repr(edges), colors
        if self._baked is None or self._baked[0] != key:
            objects = self.objects
            if edges:
                objects = self._edged.objects(edges, edit.added)
            elif any(edit.added.values()):
                objects = splats_of_objects(self.gaussians, self.shares, self._palettes, edit.added)
            self._baked = key, bake_edit(self.gaussians, objects, self._palettes, edit)
        return self._baked[1]

    def render_background(self, pinhole: Camera) -> np.ndarray:
        """Render the Gaussians of the background alone, [H, W, 3] float32 sRGB."""
        shell = replace(self.gaussians, table=self.gaussians.table[self.gaussians.n_foreground :], visibility=None)
        return rasterize(shell, pinhole).picture()


def rasterize(gaussians: Gaussians, camera: Camera, sure: np.ndarray | None = None) -> RasterizedView:
    """Rasterize Gaussians for a pinhole. sure: see `RasterizedView`."""
    from ..splats.rasterizer import rasterize as rasterized  # needs numba

    return rasterized(gaussians, camera, sure)
