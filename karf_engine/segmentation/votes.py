"""Turn coarse masks into votes on the classes of pixels and surface points.

A pixel in a mask votes for the mask's object. A pixel outside all masks of a view votes evenly for the background and
the objects without a mask in this view. Confidence grows from 0 at a mask's border, where masks are least exact, to 1 a
few pixels away, or in the middle of a thin part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from .views import CachedViews, MaskedViews

BAND_PIXELS = 6.0  # width of the band along a mask's border, pixels of a photo 200 pixels high
BAND_OF_RADIUS = 0.35  # greatest width of the band, relative to the radius of a disc of the mask's area
NEAR_BODY = 2.0  # radii around a disc's center; with less, corners of rough masks count as thin, with 3 nothing is thin
MIN_OPACITY = 0.3  # of a ray that votes


@dataclass(frozen=True)
class RayVotes:
    """The masks' votes on n cached rays."""

    targets: np.ndarray  # [n, K+1] shares of the classes; rows sum to 1
    confidence: np.ndarray  # [n] in [0, 1]; 0 in views without masks
    opacity: np.ndarray  # [n] in [0, 1], of the rays
    marked: np.ndarray  # [n] bool, rays of views with masks


def votes_of_rays(cached: CachedViews) -> RayVotes:
    """Return the votes of the cached rays; rays of low opacity get no confidence."""
    targets, confidence = _votes_of_pixels(cached.views)
    index, opacity = cached.cache.index.cpu().numpy(), cached.cache.opacity.cpu().numpy()
    confidence = confidence[index]
    return RayVotes(targets[index], confidence * (opacity > MIN_OPACITY), opacity, confidence > 0)


def _votes_of_pixels(views: MaskedViews) -> tuple[np.ndarray, np.ndarray]:
    """Return targets [N, K+1] and confidence [N] of the pixels of all views."""
    n_classes, offsets = len(views.objects) + 1, views.offsets
    targets, confidence = np.full((offsets[-1], n_classes), 1.0 / n_classes), np.zeros(offsets[-1])
    for number, masks in enumerate(views.masks):
        if masks:
            pixels = slice(offsets[number], offsets[number + 1])
            targets[pixels] = mask_targets(masks, n_classes).reshape(-1, n_classes)
            confidence[pixels] = mask_confidence(masks).ravel()
    return targets, confidence


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
    rough outline belong to the body, and only parts that lead away from it are thin.

    inside: [H, W] distance of the mask's pixels to the outside, 0 there. limit: pixels, at least 1.
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
    """Sum the votes of rays on the surface points of their samples.

    point_of_sample: [n, K] int. targets: [n, C] votes of the rays, rows sum to 1. confidence: [n] >= 0.

    Returns targets [p, C], whose rows sum to 1, and confidence [p], the sum over a point's samples. Points without
    samples have even targets and confidence 0.
    """
    n_samples = point_of_sample.shape[1]
    point = point_of_sample.ravel()
    weight = np.repeat(confidence / n_samples, n_samples)
    total = np.bincount(point, weight, n_points)
    votes = np.stack([np.bincount(point, weight * np.repeat(column, n_samples), n_points) for column in targets.T], 1)
    even = 1.0 / targets.shape[1]
    return np.where(total[:, None] > 0, votes / np.maximum(total, 1e-12)[:, None], even), total
