"""The scene as Gaussians: frames of any camera, and the objects' colors in them."""

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
from ..palettes.edge_shape import EdgeShape, shaped_edges
from ..palettes.palette import Edit, Palette
from ..splats.gaussians import Gaussians
from .borders import EdgedSplats
from .frames import Frame
from .splat_colors import ObjectSplats, planes_of_view, recolored, shares_of_objects, splats_of_objects

if TYPE_CHECKING:
    from ..splats.rasterizer import SplattedView  # needs numba


class SplattedScene:
    """A model's Gaussians, with what F_s and the palettes say of them.

    Args:
        gaussians: As learned.
        scene: The field that F_s was learned on.
        segmentation: F_s, or None before segmentation.
        palettes: Of the K objects, as learned; empty before palettes are learned.
        views: Gives those of the capture, whose pixels are measured where edges are asked for.
    """

    def __init__(
        self,
        gaussians: Gaussians,
        scene: Scene,
        segmentation: SegmentationField | None,
        palettes: Sequence[Palette],
        views: Callable[[], Sequence[View]],
    ) -> None:
        self.gaussians = gaussians
        self._scene, self._segmentation, self._palettes, self._views = scene, segmentation, palettes, views
        self._baked: tuple[Any, Gaussians | None] = (None, None)

    @cached_property
    def shares(self) -> np.ndarray:
        """Probabilities of the objects at each Gaussian, [n, K]."""
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

    def frame(self, camera: Camera, edges: Mapping[str, EdgeShape] | None = None) -> Frame:
        """What a pinhole sees, with itself as base; without palette weights before palettes are learned.

        edges: of objects that shall end otherwise, by name.
        """
        view = splatted(self.gaussians, camera)
        is_solid = np.arange(len(self.gaussians)) < self.gaussians.n_solid
        values = np.stack([is_solid, np.where(is_solid, view.depths, 0)], 1).astype(np.float32)
        opacity, depth = view.blended(values)
        depth = np.divide(depth, opacity, out=np.zeros_like(depth), where=opacity > 0)
        color = view.picture()
        picture = Picture(*map(torch.from_numpy, (color, opacity, depth)), None)
        if not self._palettes:
            return Frame(picture, view.blended(self.shares), None, color)
        objects = self._edged.objects(edges, {}) if edges else self.objects
        return Frame(picture, *planes_of_view(view, self.gaussians, objects), color)

    def recolored(self, edit: Edit) -> Gaussians:
        """The Gaussians with an edit that adds in their colors; the last one is kept. Edges are lengths, see `borders`."""
        edges, colors = shaped_edges(edit.edges), {name: colors.tobytes() for name, colors in edit.colors.items()}
        asked = repr(edit.added), repr(edges), colors
        if self._baked[0] != asked:
            objects = self.objects
            if edges:
                objects = self._edged.objects(edges, edit.added)
            elif any(edit.added.values()):
                objects = splats_of_objects(self.gaussians, self.shares, self._palettes, edit.added)
            self._baked = asked, recolored(self.gaussians, objects, self._palettes, edit)
        return self._baked[1]

    def behind(self, pinhole: Camera) -> np.ndarray:
        """What a pinhole sees behind all that is solid, [H, W, 3] float32 sRGB."""
        shell = replace(self.gaussians, table=self.gaussians.table[self.gaussians.n_solid :])
        return splatted(shell, pinhole).picture()


def splatted(gaussians: Gaussians, camera: Camera) -> SplattedView:
    """Gaussians as a pinhole sees them."""
    from ..splats.rasterizer import splatted as rasterized  # needs numba

    return rasterized(gaussians, camera)
