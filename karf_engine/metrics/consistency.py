"""View consistency: what one view shows of a surface, against what another view shows of it.

Two ways to know where a pixel went: depth and cameras (`correspond`), or optical flow (`flow_rmse`), which guesses, but
needs nothing but pictures. Pictures are [H, W, 3] in [0, 1], depth [H, W] along the optical axis (0 where empty), masks
bool [H, W]. Pixel positions: see `capture/camera.py`. A flow [H, W, 2] holds how far right and down each pixel moves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from ..capture.camera import Camera
from ..io.color import to_bytes

DEPTH_TOLERANCE = 0.01  # of the depth: what lies deeper than that behind what a view shows is hidden there


@dataclass(frozen=True)
class DepthView:
    """What one pinhole view shows: its camera, depth [H, W], and the pixels that count, bool [H, W]."""

    camera: Camera
    depth: np.ndarray
    mask: np.ndarray


@dataclass(frozen=True)
class Correspondence:
    """Surface points that two views see: pixel numbers [n] of the one, pixel positions [n, 2] in the other."""

    pixels: np.ndarray
    positions: np.ndarray

    def rmse(self, picture: np.ndarray, other: np.ndarray) -> float:
        """Root of the mean squared difference, over points and channels, of the two views' pictures; NaN for no point."""
        if not len(self.pixels):
            return float("nan")
        difference = picture.reshape(-1, 3)[self.pixels] - sampled(other, self.positions)
        return float(np.sqrt(np.mean(difference**2)))


def correspond(view: DepthView, other: DepthView) -> Correspondence:
    """The points of `view`'s mask that `other` sees too: inside its picture and mask, and not behind what it shows."""
    camera = view.camera
    pixels = np.flatnonzero(view.mask.ravel() & (view.depth.ravel() > 0))
    origins, directions = camera.rays(camera.pixel_centers()[pixels])
    points = origins + directions * view.depth.ravel()[pixels, None]
    positions, depth = other.camera.project(points)
    inside = (positions >= 0.5).all(1) & (positions <= np.array([other.camera.width, other.camera.height]) - 0.5).all(1)
    pixels, positions, depth = (values[inside & (depth > 0)] for values in (pixels, positions, depth))
    hit = np.abs(sampled(other.depth[..., None], positions)[:, 0] - depth) < DEPTH_TOLERANCE * depth
    counts = sampled(other.mask[..., None].astype(np.float64), positions)[:, 0] > 0.999
    return Correspondence(pixels[hit & counts], positions[hit & counts])


def flicker(before: Correspondence, after: Correspondence, pictures: Sequence[np.ndarray]) -> float:
    """How far the middle one of three frames in a row stands out from the two beside it; NaN where no point is in all.

    `F = sqrt(mean((c[t-1] - 2 c[t] + c[t+1])^2) / 6)` over surface points and channels, with c[t] the color of a point in
    frame t. What changes steadily, such as a highlight that wanders, cancels; noise of deviation s that is drawn anew in
    each frame gives s, for which there is the 6 = 1 + 4 + 1.

    Args:
        before: The middle view's points in the view before it.
        after: The same in the view after it.
        pictures: Of the view before, the middle one and the view after, [H, W, 3] each.
    """
    _, of_before, of_after = np.intersect1d(before.pixels, after.pixels, assume_unique=True, return_indices=True)
    if not len(of_before):
        return float("nan")
    first, middle, last = pictures
    middle = middle.reshape(-1, 3)[before.pixels[of_before]]
    beside = sampled(first, before.positions[of_before]) + sampled(last, after.positions[of_after])
    return float(np.sqrt(np.mean((beside - 2 * middle) ** 2) / 6))


def sampled(picture: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Bilinear samples [n, C] of a picture [H, W, C] at pixel positions [n, 2]."""
    coordinates = positions[:, ::-1].T - 0.5
    channels = [map_coordinates(picture[..., c], coordinates, order=1, mode="nearest") for c in range(picture.shape[2])]
    return np.stack(channels, 1)


def flow_rmse(first: np.ndarray, second: np.ndarray, shown: np.ndarray, other: np.ndarray) -> float:
    """RMSE between `shown` and `other` carried back by the flow from `first` to `second`; NaN where nothing is carried.

    first, second: the scene without the edit, which the flow is taken from; shown, other: the same two views as they
    are judged. Lai et al. 2018 with OpenCV's DIS flow in the place of a network's: hidden pixels and motion boundaries
    are left out.
    """
    carried, visible = carried_by_flow(first, second, other)
    difference = shown[visible] - carried[visible]
    return float(np.sqrt(np.mean(difference**2))) if visible.any() else float("nan")


def carried_by_flow(first: np.ndarray, second: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`other`, the view of `second`, carried back to that of `first` [H, W, 3], and where that can be trusted [H, W]."""
    forward, backward = optical_flow(first, second), optical_flow(second, first)
    return sampled(other, moved_pixels(forward)).reshape(other.shape), visible_by_flow(forward, backward)


def optical_flow(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Where each pixel of `first` is in `second`, relative to itself: [H, W, 2] float32."""
    gray = [cv2.cvtColor(to_bytes(picture), cv2.COLOR_RGB2GRAY) for picture in (first, second)]
    return cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM).calc(*gray, None)


def visible_by_flow(forward: np.ndarray, backward: np.ndarray) -> np.ndarray:
    """Pixels whose way there and back ends where it began, and around which the flow is smooth, bool [H, W]."""
    return cancel(forward, sampled(backward, moved_pixels(forward)).reshape(forward.shape))


def cancel(flow: np.ndarray, back: np.ndarray) -> np.ndarray:
    """Where `flow` [H, W, 2] and the flow `back` of the places it leads to cancel, and `flow` is smooth, bool [H, W].

    The thresholds are those of Lai et al. 2018, after Sundaram et al. 2010.
    """
    squared, back_squared = (flow**2).sum(-1), (back**2).sum(-1)
    returned = ((flow + back) ** 2).sum(-1) <= 0.01 * (squared + back_squared) + 0.5
    bend = sum((slope**2).sum(-1) for slope in np.gradient(flow, axis=(0, 1)))
    return returned & (bend <= 0.01 * squared + 0.002)


def moved_pixels(flow: np.ndarray) -> np.ndarray:
    """Pixel positions [H * W, 2] after the flow."""
    height, width = flow.shape[:2]
    v, u = np.mgrid[:height, :width]
    return np.stack([u.ravel(), v.ravel()], -1) + 0.5 + flow.reshape(-1, 2)


def mean_of_pairs(count: int, interval: int, measure: Callable[[int, int], float]) -> float:
    """Mean of measure(a, b) over all pairs of `count` views that lie `interval` apart; NaN where no pair has a measure."""
    values = np.array([measure(a, a + interval) for a in range(count - interval)])
    values = values[np.isfinite(values)]
    return float(values.mean()) if len(values) else float("nan")
