"""Views that segmentation learns from: their photos, the coarse masks drawn on some of them, and their surface samples.

Pixels are numbered through all photos in one row: those of photo v are `offsets[v]` to `offsets[v + 1]`, row by row.
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
from ..fields.rendering.surface_cache import SurfaceCache, cache_surface, join_caches
from ..palettes.exposure import exposed_alike
from ..project.settings import SegmentationSettings
from .coarse_masks import CoarseMask, load_mask

CACHE_STEP = 1.0  # sampling step in voxels: the later stages need where a ray ends, not the last digit of its color


@dataclass(frozen=True)
class MaskedViews:
    """Photos at the working size, and the coarse masks that were drawn on some of them.

    Attributes:
        objects: names of the K objects, sorted; class k is `objects[k - 1]`, class 0 the background.
        training_images: the V photos.
        masks: of each photo {class number: bool [H, W]}; empty where nothing was drawn.
    """

    objects: list[str]
    training_images: list[TrainingImage]
    masks: list[dict[int, np.ndarray]]

    @property
    def offsets(self) -> list[int]:
        """Number of each photo's first pixel, and behind them the number of all pixels, V + 1."""
        sizes = [training_image.camera.width * training_image.camera.height for training_image in self.training_images]
        return [0, *np.cumsum(sizes).tolist()]

    @property
    def n_pixels(self) -> int:
        """Number of pixels of all photos."""
        return self.offsets[-1]

    @property
    def names(self) -> list[str]:
        """Names of the views."""
        return [training_image.view.name for training_image in self.training_images]

    @property
    def masked_names(self) -> list[str]:
        """Names of the views that have a mask."""
        return [
            training_image.view.name
            for training_image, masks in zip(self.training_images, self.masks, strict=True)
            if masks
        ]

    def colors(self) -> np.ndarray:
        """Photo colors of all pixels in the photos' mean exposure, [N, 3] float32 sRGB in [0, 1]."""
        return np.concatenate(
            [exposed_alike(image.color, image.view.gains).reshape(-1, 3) for image in self.training_images]
        )


@dataclass(frozen=True)
class CachedViews:
    """Views and where their rays end in the frozen scene.

    Attributes:
        views: photos and masks.
        cache: surface samples of the n rays that end on something; its `index` numbers the pixels of all photos.
    """

    views: MaskedViews
    cache: SurfaceCache

    def pictures(self, values: np.ndarray) -> list[np.ndarray]:
        """Integers of the cached rays, [n], as one picture [H, W] a view; 0 where no ray ends on anything."""
        pixels = np.zeros(self.views.n_pixels, np.int64)
        pixels[self.cache.index.cpu().numpy()] = values
        offsets, training_images = self.views.offsets, self.views.training_images
        return [
            pixels[start:end].reshape(training_image.camera.height, training_image.camera.width)
            for start, end, training_image in zip(offsets[:-1], offsets[1:], training_images, strict=True)
        ]


def load_masked_views(
    masks: Sequence[CoarseMask],
    views: Sequence[View],
    long_side: int,
    settings: SegmentationSettings,
    more_objects: Collection[str] = (),
) -> MaskedViews:
    """Choose views spread round the scene, all masked ones among them, and load their photos and masks.

    Args:
        masks: the coarse masks, at least one.
        views: the training views, and all marked ones.
        long_side: working size of masked views, pixels; the others only have to show colors and may be smaller.
        settings: how many views, and how small (`cache_views`, `cache_long_side`).
        more_objects: names of objects that have no mask.

    Raises:
        DataError: a photo or a mask is missing, damaged or of another size.
    """
    objects = sorted({mask.object_name for mask in masks} | set(more_objects))
    masked = list(dict.fromkeys(mask.view.name for mask in masks))
    chosen = farthest_point_views(views, masked, settings.cache_views)
    small = min(long_side, settings.cache_long_side)
    training_images = [load_views([view], long_side if view.name in masked else small)[0] for view in chosen]
    per_view: list[dict[int, np.ndarray]] = [{} for _ in chosen]
    names = [view.name for view in chosen]
    for mask in masks:
        number = names.index(mask.view.name)
        per_view[number][objects.index(mask.object_name) + 1] = load_mask(mask, training_images[number])
    return MaskedViews(objects, training_images, per_view)


def farthest_point_views(views: Sequence[View], first: Sequence[str], count: int) -> list[View]:
    """Farthest point sampling of views by their cameras' positions.

    Args:
        views: to choose from, at least one.
        first: names of views that are chosen in any case; where it names none, the first view is.
        count: how many views, at most all; those of `first` may be more.

    Returns:
        The chosen views: those of `first` in the order of `views`, then always the one farthest from all chosen.
    """
    positions = np.stack([view.camera.position for view in views])
    chosen = [number for number, view in enumerate(views) if view.name in first] or [0]
    while len(chosen) < min(count, len(views)):
        distance = np.linalg.norm(positions[:, None] - positions[chosen], axis=2).min(1)
        chosen.append(int(distance.argmax()))
    return [views[number] for number in chosen]


def cache_views(scene_field: Field, views: MaskedViews, samples_per_ray: int, progress: Progress) -> CachedViews:
    """Surface samples of all pixels of the views.

    Args:
        scene_field: the frozen radiance field.
        views: their cameras are looked through.
        samples_per_ray: quantile samples a ray, at least 1.
        progress: counts pixels, `views.n_pixels` of them.

    Raises:
        DataError: no ray ends on anything.
    """
    parts = []
    for training_image, start in zip(views.training_images, views.offsets[:-1], strict=True):
        rays = camera_rays(training_image.camera, scene_field.bounds.device)
        part = cache_surface(scene_field, rays, samples_per_ray, CACHE_STEP, progress)
        parts.append(replace(part, index=part.index + start))
    cache = join_caches(parts)
    if not len(cache):
        raise DataError("The learned scene shows nothing solid in any photo.", "Learn it again, with other settings.")
    return CachedViews(views, cache)
