"""The views that segmentation learns from: photos, coarse masks of some of them, surface samples, and the masks' votes.

Pixels of all photos are numbered consecutively: photo v has `offsets[v]` to `offsets[v + 1]`, row by row.

A pixel in a mask votes for the mask's object. A pixel outside all masks of a view votes evenly for the background and
the objects without a mask in this view. Confidence grows from 0 at a mask's border, where masks are least exact, to 1 a
few pixels away, or in the middle of a thin part.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import distance_transform_edt

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
BAND_PIXELS = 6.0  # width of the band along a mask's border, pixels of a photo 200 pixels high
BAND_OF_RADIUS = 0.35  # greatest width of the band, relative to the radius of a disc of the mask's area
NEAR_BODY = 2.0  # radii around a disc's center; with less, corners of rough masks count as thin, with 3 nothing is thin
MIN_OPACITY = 0.3  # of a ray that votes


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
    views: Sequence[View],  # of the capture; training views and masked ones are used
    long_side: int,  # working size of masked views, pixels
    settings: SegmentationSettings,
    more_objects: Collection[str] = (),  # without masks
) -> MaskedViews:
    """Choose all masked views and others spread around the scene, and load their photos and masks.

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


@dataclass(frozen=True)
class RayVotes:
    """The masks' votes on n cached rays."""

    targets: np.ndarray  # [n, K+1] shares of the classes; rows sum to 1
    confidence: np.ndarray  # [n] in [0, 1]; 0 in views without masks
    opacity: np.ndarray  # [n] in [0, 1], of the rays
    marked: np.ndarray  # [n] bool, rays of views with masks


def votes_of_rays(cached: CachedViews) -> RayVotes:
    """Return the votes of the cached rays; rays of low opacity get no confidence."""
    views, n_classes = cached.views, len(cached.views.objects) + 1
    offsets = views.offsets
    targets, confidence = np.full((offsets[-1], n_classes), 1.0 / n_classes), np.zeros(offsets[-1])
    for number, masks in enumerate(views.masks):
        if masks:
            pixels = slice(offsets[number], offsets[number + 1])
            targets[pixels] = mask_targets(masks, n_classes).reshape(-1, n_classes)
            confidence[pixels] = mask_confidence(masks).ravel()
    index, opacity = cached.cache.index.cpu().numpy(), cached.cache.opacity.cpu().numpy()
    confidence = confidence[index]
    return RayVotes(targets[index], confidence * (opacity > MIN_OPACITY), opacity, confidence > 0)


def mask_targets(masks: dict[int, np.ndarray], n_classes: int) -> np.ndarray:
    """Return the votes of one view's pixels, [H, W, n_classes] float64; they sum to 1. Overlapping masks share a pixel.

    masks: {class number: bool [H, W]}, at least one. n_classes: K + 1, background included.
    """
    height, width = next(iter(masks.values())).shape
    targets = np.zeros((height, width, n_classes))
    for number, mask in masks.items():
        targets[mask, number] = 1
    without_mask = [k for k in range(n_classes) if k not in masks]
    outside = targets.sum(2) == 0
    targets[np.ix_(np.arange(height), np.arange(width), without_mask)] += outside[..., None]
    return targets / targets.sum(2, keepdims=True)


def mask_confidence(masks: dict[int, np.ndarray]) -> np.ndarray:
    """Return the confidence of one view's pixels, [H, W] float64 in [0, 1]."""
    height, width = next(iter(masks.values())).shape
    confidence = np.ones((height, width))
    for mask in masks.values():
        if not mask.any() or mask.all():
            continue
        band = max(min(BAND_PIXELS * height / 200, BAND_OF_RADIUS * np.sqrt(mask.sum() / np.pi)), 1.0)
        inside, outside = (np.asarray(distance_transform_edt(each)) for each in (mask, ~mask))
        confidence = np.minimum(confidence, np.where(mask, inside / half_width(inside, band), outside / band))
    return np.minimum(confidence, 1.0)


def half_width(inside: np.ndarray, limit: float) -> np.ndarray:
    """Return half of the mask's width at each pixel, [H, W] in [1, limit]; 1 outside the mask.

    It is the radius of the largest inscribed disc that covers the pixel or is close to it, so corners and bumps of a
    rough outline belong to the body. inside: [H, W] distance of the mask's pixels to the outside, 0 there.
    """
    width = np.ones(inside.shape)
    for radius in np.linspace(1, limit, 6)[1:]:
        centers = inside >= radius
        if not centers.any():
            break
        width[(inside > 0) & (distance_transform_edt(~centers) < NEAR_BODY * radius)] = radius
    return width


def vote_on_points(
    point_of_sample: np.ndarray, targets: np.ndarray, confidence: np.ndarray, n_points: int
) -> tuple[np.ndarray, np.ndarray]:
    """Sum the votes of rays, targets [n, C] and confidence [n] >= 0, on the points of their samples [n, K].

    Returns targets [p, C], whose rows sum to 1, and confidence [p]; even targets and 0 for points without samples.
    """
    n_samples = point_of_sample.shape[1]
    point = point_of_sample.ravel()
    weight = np.repeat(confidence / n_samples, n_samples)
    total = np.bincount(point, weight, n_points)
    votes = np.stack([np.bincount(point, weight * np.repeat(column, n_samples), n_points) for column in targets.T], 1)
    even = 1.0 / targets.shape[1]
    return np.where(total[:, None] > 0, votes / np.maximum(total, 1e-12)[:, None], even), total
