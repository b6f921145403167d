"""The views that segmentation learns from: photos, coarse masks of some of them, and surface samples.

Pixels of all photos are numbered consecutively: photo v has `offsets[v]` to `offsets[v + 1]`, row by row.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..capture.capture import View
from ..capture.training_images import TrainingImage, load_views
from ..compute.progress import Progress
from ..errors import DataError
from ..fields.protocol import Field
from ..fields.rendering.rays import camera_rays
from ..fields.rendering.surface_cache import SurfaceCache, cache_surface, concatenate_caches
from ..palettes.calibration import to_mean_exposure
from ..project.settings import SegmentationSettings
from .coarse_masks import CoarseMask, load_mask

CACHE_STEP = 1.0  # voxels; coarse, since only the ends of rays matter here


@dataclass(frozen=True)
class MaskedViews:
    """Photos at the working size, and the coarse masks of some of them."""

    objects: list[str]  # K names, sorted; class k is `objects[k - 1]`, class 0 the background
    training_images: list[TrainingImage]
    masks: list[dict[int, np.ndarray]]  # {class number: bool [H, W]} of each photo; empty for unmarked ones

    @property
    def offsets(self) -> list[int]:
        """The number of each photo's first pixel, and finally of all pixels, V + 1."""
        sizes = [training_image.camera.width * training_image.camera.height for training_image in self.training_images]
        return [0, *np.cumsum(sizes).tolist()]

    @property
    def n_pixels(self) -> int:
        return self.offsets[-1]

    @property
    def names(self) -> list[str]:
        return [training_image.view.name for training_image in self.training_images]

    @property
    def masked_names(self) -> list[str]:
        return [name for name, masks in zip(self.names, self.masks, strict=True) if masks]

    def colors(self) -> np.ndarray:
        """Return the colors of all pixels in the photos' mean exposure, [N, 3] float32 sRGB in [0, 1]."""
        return np.concatenate(
            [to_mean_exposure(image.color, image.view.gains).reshape(-1, 3) for image in self.training_images]
        )


@dataclass(frozen=True)
class CachedViews:
    """Views with the surface samples of their rays."""

    views: MaskedViews
    cache: SurfaceCache  # of the n rays that hit something; `index` is the pixel number over all photos

    def pictures(self, values: np.ndarray) -> list[np.ndarray]:
        """Return integers of the cached rays, [n], as one picture [H, W] per view; 0 where a ray hits nothing."""
        pixels = np.zeros(self.views.n_pixels, np.int64)
        pixels[self.cache.index.cpu().numpy()] = values
        cameras = [image.camera for image in self.views.training_images]
        parts = np.split(pixels, self.views.offsets[1:-1])
        return [part.reshape(camera.height, camera.width) for part, camera in zip(parts, cameras, strict=True)]


def load_masked_views(
    masks: Sequence[CoarseMask],
    views: Sequence[View],
    long_side: int,
    settings: SegmentationSettings,
    more_objects: Collection[str] = (),
) -> MaskedViews:
    """Choose all masked views and others spread around the scene, and load their photos and masks.

    views: of the capture; training views and masked ones are used. long_side: working size of masked views, pixels.
    more_objects: names of objects without masks.

    Raises DataError where a photo or a mask is missing, damaged or of another size.
    """
    objects = sorted({mask.object_name for mask in masks} | set(more_objects))
    masked = {mask.view.name for mask in masks}
    usable = [view for view in views if view.split == "train" or view.name in masked]
    chosen = farthest_point_views(usable, masked, settings.cache_views)
    small = min(long_side, settings.cache_long_side)
    training_images = [load_views([view], long_side if view.name in masked else small)[0] for view in chosen]
    per_view: list[dict[int, np.ndarray]] = [{} for _ in chosen]
    names = [view.name for view in chosen]
    for mask in masks:
        number = names.index(mask.view.name)
        per_view[number][objects.index(mask.object_name) + 1] = load_mask(mask, training_images[number])
    return MaskedViews(objects, training_images, per_view)


def farthest_point_views(views: Sequence[View], first: Collection[str], count: int) -> list[View]:
    """Choose at most `count` views by farthest point sampling of their cameras' positions; more if `first` names more.

    The views named in `first` (by default the first one) come first, then each time the view farthest from all chosen.
    """
    positions = np.stack([view.camera.position for view in views])
    chosen = [number for number, view in enumerate(views) if view.name in first] or [0]
    while len(chosen) < min(count, len(views)):
        distance = np.linalg.norm(positions[:, None] - positions[chosen], axis=2).min(1)
        chosen.append(int(distance.argmax()))
    return [views[number] for number in chosen]


def cache_views(scene_field: Field, views: MaskedViews, samples_per_ray: int, progress: Progress) -> CachedViews:
    """Trace the rays of all pixels to the surface, with at least 1 quantile sample per ray. progress: counts pixels.

    Raises DataError where no ray hits anything.
    """
    parts = []
    for training_image, start in zip(views.training_images, views.offsets[:-1], strict=True):
        rays = camera_rays(training_image.camera, scene_field.bounds.device)
        part = cache_surface(scene_field, rays, samples_per_ray, CACHE_STEP, progress)
        parts.append(replace(part, index=part.index + start))
    cache = concatenate_caches(parts)
    if not len(cache):
        raise DataError("The learned scene shows nothing solid in any photo.", "Learn it again, with other settings.")
    return CachedViews(views, cache)
