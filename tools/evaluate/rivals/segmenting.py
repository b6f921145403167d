"""Segmentations of the test views by each rule, from the same rough masks: probabilities [K, H, W] of each view."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import torch

from karf_engine.fields.rendering.surface_cache import SurfaceCache
from karf_engine.segmentation.coarse_masks import find_masks
from karf_engine.segmentation.views import CachedViews, cache_views, load_masked_views

from ..views import TestViews, learn_again, terminal_progress, with_model
from .sa3d import MaskGrid, RayView, self_prompted

Masks = list[np.ndarray]


@dataclass(frozen=True)
class Segmenting:
    """What all rules are given.

    Attributes:
        test: The test views, whose frames keep their surface samples.
        masks: The folder of rough masks.
    """

    test: TestViews
    masks: Path

    @cached_property
    def cached(self) -> CachedViews:
        """The training views that our own segmentation learns from, with the rough masks, and where their rays end."""
        model = self.test.model
        settings, field = model.settings.segmentation, model.scene.field
        marks = find_masks(self.masks, model.capture)
        marked = {mark.view.name for mark in marks}
        learned_from = [view for view in model.capture.views if view.split == "train" or view.name in marked]
        views = load_masked_views(marks, learned_from, model.settings.geometry.long_side, settings)
        return cache_views(field, views, settings.samples_per_ray, terminal_progress("surface", views.n_pixels))

    def sa3d(self) -> Masks:
        """Return the masks of SA3D's voxels: from the given masks, then from masks prompted in all other views."""
        grids = [self._grid(number) for number in range(1, self.n_objects + 1)]
        rendered = [[view.picture(grid.render(view.cache)) for grid in grids] for view in self._test_rays()]
        return [_highest(np.stack(masks)) for masks in rendered]

    def plain(self, folder: Path, threads: int | None) -> Masks:
        """F_s by the paper's Eq. 12, cross-entropy on the masks as they are; learned in a scratch project."""
        overrides = ["segmentation.labels=masks"]
        model = learn_again(self.test.model, folder, overrides, ("segmentation",), self.masks, threads)
        return [frame.probabilities for frame in with_model(self.test, model, "photo").frames]

    @property
    def n_objects(self) -> int:
        """K."""
        return len(self.test.model.objects)

    def _grid(self, number: int) -> MaskGrid:
        """The voxels of one object, from its marked views and on through all others, the nearest first."""
        field, masks = self.test.model.scene.field, self.cached.views.masks
        grid, views = MaskGrid(field.bounds, field.voxel), self._training_rays
        marked = [view for view in range(len(views)) if number in masks[view]]
        for view in marked:
            grid.project(views[view].cache, views[view].of_rays(masks[view][number]))
        places = np.stack([image.camera.position for image in self.cached.views.training_images])
        nearest = np.argsort(np.linalg.norm(places - places[marked[0]], axis=1))
        self_prompted(grid, [views[view] for view in nearest if view not in marked])
        return grid

    @cached_property
    def _training_rays(self) -> list[RayView]:
        offsets, cache = self.cached.views.offsets, self.cached.cache
        views = []
        for number, image in enumerate(self.cached.views.training_images):
            own = torch.nonzero((cache.index >= offsets[number]) & (cache.index < offsets[number + 1])).squeeze(1)
            part = SurfaceCache(*[getattr(cache, item.name)[own] for item in fields(SurfaceCache)])
            views.append(RayView(image.color, replace(part, index=part.index - offsets[number])))
        return views

    def _test_rays(self) -> list[RayView]:
        return [RayView(frame.base, frame.picture.cache) for frame in self.test.frames]


def _highest(rendered: np.ndarray) -> np.ndarray:
    """Of rendered masks [K, H, W] the highest in each pixel as probability 1, where it is above 0."""
    return ((rendered == rendered.max(0)) & (rendered > 0)).astype(np.float32)
