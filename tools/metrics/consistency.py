"""View consistency: compare the colors of the same surface in two views.

Pixels are matched by depth and cameras (`match_by_depth`), or by optical flow (`flow_rmse`), which needs only pictures.
Pictures are [H, W, 3] in [0, 1], depth [H, W] along the optical axis (0 where empty), masks bool [H, W], flow [H, W, 2] to
the right and down, pixel positions as in `capture/camera.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from karf_engine.capture.camera import Camera
from karf_engine.io.color import to_bytes

DEPTH_TOLERANCE = 0.01  # relative; points farther behind the visible surface are hidden


@dataclass(frozen=True)
class DepthView:
    """A pinhole view."""

    camera: Camera
    depth: np.ndarray  # [H, W]
    mask: np.ndarray  # pixels that count, bool [H, W]


@dataclass(frozen=True)
class Correspondence:
    """Surface points visible in two views."""

    pixels: np.ndarray  # indices in one view, [n]
    positions: np.ndarray  # in the other view, [n, 2]

    def rmse(self, picture: np.ndarray, other: np.ndarray) -> float:
        """Return the RMSE of two pictures over points and channels; NaN without points."""
        if not len(self.pixels):
            return float("nan")
        difference = picture.reshape(-1, 3)[self.pixels] - sample_bilinear(other, self.positions)
        return float(np.sqrt(np.mean(difference**2)))


def match_by_depth(view: DepthView, other: DepthView) -> Correspondence:
    """Return the points of `view`'s mask that are visible in `other`, inside its mask."""
    camera = view.camera
    pixels = np.flatnonzero(view.mask.ravel() & (view.depth.ravel() > 0))
    origins, directions = camera.rays(camera.pixel_centers()[pixels])
    points = origins + directions * view.depth.ravel()[pixels, None]
    positions, depth = other.camera.project(points)
    inside = (positions >= 0.5).all(1) & (positions <= np.array([other.camera.width, other.camera.height]) - 0.5).all(1)
    pixels, positions, depth = (values[inside & (depth > 0)] for values in (pixels, positions, depth))
    hit = np.abs(sample_bilinear(other.depth[..., None], positions)[:, 0] - depth) < DEPTH_TOLERANCE * depth
    counts = sample_bilinear(other.mask[..., None].astype(np.float64), positions)[:, 0] > 0.999
    return Correspondence(pixels[hit & counts], positions[hit & counts])


def flicker(before: Correspondence, after: Correspondence, pictures: Sequence[np.ndarray]) -> float:
    """Return the flicker of three consecutive frames; NaN where no point is in all of them.

    `F = sqrt(mean((c[t-1] - 2 c[t] + c[t+1])^2) / 6)` over surface points and channels, with c[t] the color of a point in
    frame t. Steady changes cancel; independent noise of deviation s gives F = s. `before` and `after` match the middle
    view with the view before and after it; pictures are in order.
    """
    _, of_before, of_after = np.intersect1d(before.pixels, after.pixels, assume_unique=True, return_indices=True)
    if not len(of_before):
        return float("nan")
    first, middle, last = pictures
    middle = middle.reshape(-1, 3)[before.pixels[of_before]]
    beside = sample_bilinear(first, before.positions[of_before]) + sample_bilinear(last, after.positions[of_after])
    return float(np.sqrt(np.mean((beside - 2 * middle) ** 2) / 6))


def sample_bilinear(picture: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return bilinear samples [n, C] of a picture [H, W, C] at pixel positions [n, 2]."""
    coordinates = positions[:, ::-1].T - 0.5
    channels = [map_coordinates(picture[..., c], coordinates, order=1, mode="nearest") for c in range(picture.shape[2])]
    return np.stack(channels, 1)


def flow_rmse(first: np.ndarray, second: np.ndarray, shown: np.ndarray, other: np.ndarray) -> float:
    """Return the RMSE between `shown` and `other` warped by the flow from `first` to `second`; NaN without valid pixels.

    `first` and `second` are the views without the edit. As Lai et al. 2018, without hidden pixels and motion boundaries,
    but with OpenCV's DIS flow instead of a network.
    """
    forward, backward = optical_flow(first, second), optical_flow(second, first)
    warped = sample_bilinear(other, warp_positions(forward)).reshape(other.shape)
    visible = visible_by_flow(forward, backward)
    difference = shown[visible] - warped[visible]
    return float(np.sqrt(np.mean(difference**2))) if visible.any() else float("nan")


def optical_flow(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the flow from `first` to `second`, [H, W, 2] float32."""
    gray = [cv2.cvtColor(to_bytes(picture), cv2.COLOR_RGB2GRAY) for picture in (first, second)]
    dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    return dis.calc(*gray, None)  # pyright: ignore[reportArgumentType, reportCallIssue]


def visible_by_flow(forward: np.ndarray, backward: np.ndarray) -> np.ndarray:
    """Return True for pixels that both flows bring back to their start, where the flow is smooth, bool [H, W]."""
    returning = sample_bilinear(backward, warp_positions(forward)).reshape(forward.shape)
    return forward_backward_consistent(forward, returning)


def forward_backward_consistent(flow: np.ndarray, back: np.ndarray) -> np.ndarray:
    """Return True where the flow and the `back` flow at its target cancel and the flow is smooth, bool [H, W].

    The thresholds are those of Lai et al. 2018, after Sundaram et al. 2010.
    """
    squared, back_squared = (flow**2).sum(-1), (back**2).sum(-1)
    returned = ((flow + back) ** 2).sum(-1) <= 0.01 * (squared + back_squared) + 0.5
    bend = sum((slope**2).sum(-1) for slope in np.gradient(flow, axis=(0, 1)))
    return returned & (bend <= 0.01 * squared + 0.002)


def warp_positions(flow: np.ndarray) -> np.ndarray:
    """Return the pixel positions [H * W, 2] after the flow."""
    height, width = flow.shape[:2]
    v, u = np.mgrid[:height, :width]
    return np.stack([u.ravel(), v.ravel()], -1) + 0.5 + flow.reshape(-1, 2)


def mean_of_pairs(count: int, interval: int, measure: Callable[[int, int], float]) -> float:
    """Return the mean of measure(a, a + interval) over `count` views, ignoring NaN; NaN if all are."""
    values = np.array([measure(a, a + interval) for a in range(count - interval)])
    values = values[np.isfinite(values)]
    return float(values.mean()) if len(values) else float("nan")
