"""Votes of coarse masks on the classes of pixels and surface points.

A masked view holds masks of some of the objects. A pixel in a mask votes for that object. A pixel outside all of them
votes evenly for the background and for the objects that have no mask in this view: it may well be one of those.
Confidence grows from 0 at a mask's border, where hands are least exact, to 1 a few pixels away. A thin part of a mask
never gets that far from the border: there it grows to 1 in the part's middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from .views import CachedViews, MaskedViews

BAND_PIXELS = 6.0  # width of the band along a mask's border, pixels of a photo 200 pixels high
BAND_OF_RADIUS = 0.35
WIDTHS = 6  # of a mask that are told apart, from one pixel to the whole band; not varied on record
NEAR_BODY = 2.0  # radii round a disc's center that count as its width; 1, 1.5, 3 were measured on drawn seeds 0 to 7 and the demo:
# with less corners of rough masks count too much (seed 7 loses 0.05 of IoU by 1.5), with 3 nothing is thin
LEAST_OPACITY = 0.3  # opacity of a ray that votes


@dataclass(frozen=True)
class RayVotes:
    """The masks' votes on n cached rays.

    Attributes:
        targets: [n, K+1] shares of the classes; rows sum to 1.
        confidence: [n] in [0, 1]; 0 in views without masks.
        opacity: [n] in [0, 1], of the rays.
        marked: [n] bool, rays of the views that have masks.
    """

    targets: np.ndarray
    confidence: np.ndarray
    opacity: np.ndarray
    marked: np.ndarray


def votes_of_rays(cached: CachedViews) -> RayVotes:
    """The votes of the cached rays. Rays of low opacity hardly end on anything: their confidence is 0."""
    targets, confidence = votes_of_pixels(cached.views)
    index, opacity = cached.cache.index.cpu().numpy(), cached.cache.opacity.cpu().numpy()
    confidence = confidence[index]
    return RayVotes(targets[index], confidence * (opacity > LEAST_OPACITY), opacity, confidence > 0)


def votes_of_pixels(views: MaskedViews) -> tuple[np.ndarray, np.ndarray]:
    """Targets [N, K+1] and confidence [N] of the pixels of all views; see `mask_targets` and `mask_confidence`."""
    n_classes, offsets = len(views.objects) + 1, views.offsets
    targets, confidence = np.full((offsets[-1], n_classes), 1.0 / n_classes), np.zeros(offsets[-1])
    for number, masks in enumerate(views.masks):
        if masks:
            pixels = slice(offsets[number], offsets[number + 1])
            targets[pixels] = mask_targets(masks, n_classes).reshape(-1, n_classes)
            confidence[pixels] = mask_confidence(masks).ravel()
    return targets, confidence


def mask_targets(masks: dict[int, np.ndarray], n_classes: int) -> np.ndarray:
    """Which classes the pixels of one view may have.

    Args:
        masks: {class number: bool [H, W]}, at least one. Where masks overlap they share the pixel.
        n_classes: K + 1, background included.

    Returns:
        [H, W, n_classes] float64; rows sum to 1.
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
    """How far each pixel lies from the masks' borders: 0 on one, 1 a few pixels away, or in the middle of a thin part.

    Args:
        masks: {class number: bool [H, W]}, at least one.

    Returns:
        [H, W] float64 in [0, 1].
    """
    height, width = next(iter(masks.values())).shape
    confidence = np.ones((height, width))
    for mask in masks.values():
        if not mask.any() or mask.all():
            continue
        band = max(min(BAND_PIXELS * height / 200, BAND_OF_RADIUS * np.sqrt(mask.sum() / np.pi)), 1.0)
        inside, outside = distance_transform_edt(mask), distance_transform_edt(~mask)
        confidence = np.minimum(confidence, np.where(mask, inside / half_width(inside, band), outside / band))
    return np.minimum(confidence, 1.0)


def half_width(inside: np.ndarray, most: float) -> np.ndarray:
    """Half the mask's width at each pixel: radius of the largest disc within the mask that covers it or is close to it.

    So a corner and a bump of a rough outline are of the body, and only what leads away from it is thin.

    Args:
        inside: [H, W] distance of the mask's pixels to what is outside, 0 there.
        most: radius up to which widths are told apart, pixels, at least 1.

    Returns:
        [H, W] in [1, most]; 1 outside.

    Examples:
        >>> handle_on_a_body = np.zeros((20, 40), bool)
        >>> handle_on_a_body[9:12, 3:20] = handle_on_a_body[2:18, 20:36] = True
        >>> half_width(distance_transform_edt(handle_on_a_body), 6.0)[10, [5, 28]].tolist()
        [2.0, 6.0]
    """
    width = np.ones(inside.shape)
    for radius in np.linspace(1, most, WIDTHS)[1:]:
        centers = inside >= radius
        if not centers.any():
            break
        width[(inside > 0) & (distance_transform_edt(~centers) < NEAR_BODY * radius)] = radius
    return width


def vote_on_points(
    point_of_sample: np.ndarray, targets: np.ndarray, confidence: np.ndarray, n_points: int
) -> tuple[np.ndarray, np.ndarray]:
    """Sum the votes of rays on the surface points that their samples belong to.

    Args:
        point_of_sample: [n, K] int, point of each sample of each ray.
        targets: [n, C] votes of the rays; rows sum to 1.
        confidence: [n] >= 0.
        n_points: p.

    Returns:
        Targets [p, C], whose rows sum to 1, and confidence [p]: the sum over a point's samples, 0 and an even target
        where there are none.
    """
    n_samples = point_of_sample.shape[1]
    point = point_of_sample.ravel()
    weight = np.repeat(confidence / n_samples, n_samples)
    total = np.bincount(point, weight, n_points)
    votes = np.stack([np.bincount(point, weight * np.repeat(column, n_samples), n_points) for column in targets.T], 1)
    even = 1.0 / targets.shape[1]
    return np.where(total[:, None] > 0, votes / np.maximum(total, 1e-12)[:, None], even), total
