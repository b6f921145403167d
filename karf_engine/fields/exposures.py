"""Relative exposure of photos: gains of red, green and blue, from surface points that several photos show.

A field fits differently exposed photos by view-dependent colors, so its renders do not reveal exposures. Its geometry,
even half-learned, does: it tells where two photos show the same point. Gains apply to sRGB values; they approximate
gains in linear light except in dark tones, and also cover white balance.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..capture.camera import Camera
from ..compute.neighbors import build_kd_tree
from ..io.images import resize
from .extent import focus_point
from .rendering.rays import PixelDataset
from .scene import Scene

LONG_SIDE = 64  # pixels of the reduced photos
NEIGHBORS = 16  # nearest cameras that each photo is compared with; farther ones see other highlights
MIN_OPACITY = 0.8  # of a pixel on a surface
DEPTH_TOLERANCE = 0.04  # difference between two photos of the same point, share of the distance
DARKEST = 0.06  # sRGB; darker pixels are noise
BRIGHTEST = 0.94  # sRGB; brighter pixels may be clipped
MIN_POINTS = 40  # shared points of a pair of photos
OUTLIER = 1.5  # typical errors beyond which a pair gets less weight (Huber)
MIN_PHOTOS = 8  # fewer photos get gains of 1
CELLS = 6  # along the longest side of the scene; a checkerboard splits the points into halves
MIN_RELIABILITY = 0.9  # correlation of the two halves' log gains below which gains are 1
MIN_DEVIATION = 0.02  # standard deviation of log gains below which gains are 1
REACHES = (2.0, 4.0, 8.0)  # length scales of view-dependent effects, in distances between cameras
VARIANCE_RATIOS = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)  # view-dependent to independent variance
ITERATIONS = 10  # of reweighted least squares
EPSILON = 1e-9


def estimate_photo_gains(scene: Scene, dataset: PixelDataset) -> np.ndarray:
    """Estimate the gain of each photo of the dataset from the geometry of a partly learned scene.

    Returns [V, 3] float32 with a geometric mean of 1; exactly 1 where photos agree or the estimate is unreliable.
    """
    cameras = dataset.cameras
    if len(cameras) < MIN_PHOTOS:
        return np.ones((len(cameras), 3), np.float32)
    samples = [_sample_view(scene, dataset, number) for number in range(len(cameras))]
    medians, half, other = (
        _remove_view_dependence(_log_gains(each, len(cameras)), cameras) for each in _medians(_pairs(samples))
    )
    return _shrunk_gains(medians, half, other)


def gains_from_render(scene: Scene, camera: Camera, photo: np.ndarray) -> tuple[float, float, float]:
    """Estimate the red, green and blue gain of a photo that the scene was not learned from, by comparison with a render.

    The photo is sRGB [H, W, 3] in [0, 1] of a pinhole; the scene was learned at the mean exposure of its photos. Channels
    with too few pixels get 1.
    """
    camera = camera.reduced(LONG_SIDE)
    picture = scene.render(camera, 1)
    is_solid = picture.opacity.cpu().numpy() > MIN_OPACITY
    own = resize(photo, camera.width, camera.height)[is_solid]
    ratios = _log_ratios(own, picture.color.cpu().numpy()[is_solid])

    def gain(log_ratios: np.ndarray) -> float:
        known = log_ratios[~np.isnan(log_ratios)]
        return float(np.exp(np.median(known))) if len(known) >= MIN_POINTS else 1.0

    red, green, blue = ratios.T
    return gain(red), gain(green), gain(blue)


def _shrunk_gains(log_gains: np.ndarray, half: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Turn log gains [V, 3] into gains, shrunk by their split-half reliability (Spearman 1910, Brown 1910)."""
    correlation = 2 * (half * other).mean() / max((half**2).mean() + (other**2).mean(), EPSILON)
    logs = log_gains * (2 * correlation / (1 + correlation) if correlation > MIN_RELIABILITY else 0)
    if logs.std() < MIN_DEVIATION:
        return np.ones(log_gains.shape, np.float32)
    return np.exp(logs - logs.mean(0)).astype(np.float32)


@dataclass(frozen=True)
class _ViewSample:
    """A reduced photo [H, W, 3], with the surface points [H * W, 3] of its pixels and their distances, 0 if open."""

    camera: Camera
    photo: np.ndarray
    points: np.ndarray
    distances: np.ndarray


def _sample_view(scene: Scene, dataset: PixelDataset, number: int) -> _ViewSample:
    camera = dataset.cameras[number].reduced(LONG_SIDE)
    picture = scene.render(camera, 1)
    origins, directions = camera.rays(camera.pixel_centers())
    steps = picture.depth.cpu().numpy().reshape(-1, 1) * directions
    is_solid = picture.opacity.cpu().numpy().ravel() > MIN_OPACITY
    photo = resize(dataset.image(number), camera.width, camera.height)
    return _ViewSample(camera, photo, origins + steps, np.where(is_solid, np.linalg.norm(steps, axis=1), 0))


def _pairs(samples: Sequence[_ViewSample]) -> Iterator[tuple[int, int, np.ndarray, np.ndarray]]:
    """Yield each photo with each of its nearest neighbors, and their n shared points.

    Log color ratios [n, 3], NaN where unusable, and the points' halves of the checkerboard, [n] bool.
    """
    points = np.concatenate([sample.points[sample.distances > 0] for sample in samples])
    if not len(points):
        return
    low, high = np.quantile(points, np.array([0.02, 0.98]), axis=0)
    cell = (high - low).max() / CELLS
    positions = np.stack([sample.camera.position for sample in samples])
    _, nearest = build_kd_tree(positions).query(positions, min(NEIGHBORS + 1, len(samples)))
    for number, sample in enumerate(samples):
        half = np.floor((sample.points - low) / max(cell, EPSILON)).sum(1) % 2 == 1
        for other in nearest[number]:
            if other != number:
                pixels, ratios = _ratios(sample, samples[other])
                yield number, int(other), ratios, half[pixels]


def _ratios(sample: _ViewSample, other: _ViewSample) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels [n] of a sample whose points the other photo shows too, and log color ratios [n, 3]."""
    width, height = other.camera.width, other.camera.height
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels, depth = other.camera.project(sample.points)
    inside = (pixels >= 0.5).all(1) & (pixels <= (width - 0.5, height - 0.5)).all(1)
    shared = np.flatnonzero((sample.distances > 0) & (depth > 0) & inside)
    column, row = pixels[shared].astype(int).T
    distance = np.linalg.norm(sample.points[shared] - other.camera.position, axis=1)
    error = np.abs(other.distances[row * width + column] - distance)
    shared = shared[error < DEPTH_TOLERANCE * distance]
    if not len(shared):
        return shared, np.empty((0, 3))
    at = (pixels[shared] - 0.5).astype(np.float32)
    color = cv2.remap(other.photo, at[:, :1], at[:, 1:], cv2.INTER_LINEAR)[:, 0]
    return shared, _log_ratios(sample.photo.reshape(-1, 3)[shared], color)


def _log_ratios(own: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return log(own / other) of colors [n, 3], NaN where one is clipped or dark."""
    usable = (np.minimum(own, other) > DARKEST) & (np.maximum(own, other) < BRIGHTEST)
    return np.log(np.where(usable, own, np.nan) / np.where(usable, other, 1))


def _medians(pairs: Iterator[tuple[int, int, np.ndarray, np.ndarray]]) -> tuple[list[list[tuple]], ...]:
    """Return (first, second, median, count) of the pairs of each channel: of all points and of either half."""
    found = tuple([[] for _ in range(3)] for _ in range(3))
    for first, second, ratios, half in pairs:
        for kind, chosen in enumerate((slice(None), half, ~half)):
            for channel, values in enumerate(ratios[chosen].T):
                known = values[~np.isnan(values)]
                if len(known) >= MIN_POINTS:
                    found[kind][channel].append((first, second, np.median(known), len(known)))
    return found


def _log_gains(medians: Sequence[Sequence[tuple]], count: int) -> np.ndarray:
    """Solve for the log gains [V, 3], with mean 0, whose differences fit the medians of the pairs."""
    return np.stack([_channel_log_gains(np.array(each).reshape(-1, 4), count) for each in medians], 1)


def _channel_log_gains(medians: np.ndarray, count: int) -> np.ndarray:
    if not len(medians):
        return np.zeros(count)
    first, second = medians[:, :2].astype(int).T
    system = np.zeros((len(medians), count))
    system[np.arange(len(medians)), first] = 1
    system[np.arange(len(medians)), second] = -1
    weights, trust = medians[:, 3] / medians[:, 3].mean(), np.ones(len(medians))
    prior = 1e-6 * np.eye(count)  # photos without pairs get the mean exposure
    logs = np.zeros(count)
    for _ in range(ITERATIONS):
        rows = system * (weights * trust)[:, None]
        logs = np.linalg.solve(system.T @ rows + prior, rows.T @ medians[:, 2])
        errors = np.abs(system @ logs - medians[:, 2])
        trust = np.minimum(1, OUTLIER * 1.4826 * np.median(errors) / np.maximum(errors, EPSILON))
    return logs - logs.mean()


def _remove_view_dependence(logs: np.ndarray, cameras: Sequence[Camera]) -> np.ndarray:
    """Remove the part of log gains [V, 3] that varies smoothly with the camera's direction, as highlights and skies do.

    The model is independent noise plus a Gaussian process of the direction, with maximum-likelihood variances and
    length scale, separately for brightness and tint; the result is the posterior mean of the noise (Rasmussen and
    Williams 2006).
    """
    towards = np.stack([camera.position for camera in cameras]) - focus_point(list(cameras)).numpy()
    towards /= np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), EPSILON)
    apart = np.linalg.norm(towards[:, None] - towards, axis=2)
    spacing = np.median((apart + 9 * np.eye(len(apart))).min(1))
    kernels = [np.exp(-0.5 * (apart / max(reach * spacing, EPSILON)) ** 2) for reach in REACHES]
    brightness = logs.mean(1, keepdims=True)
    return _independent_part(brightness, kernels) + _independent_part(logs - brightness, kernels)


def _independent_part(values: np.ndarray, kernels: Sequence[np.ndarray]) -> np.ndarray:
    """Return the part of values [V, n] that is not a Gaussian process with one of these kernels [V, V]."""
    center = np.eye(len(values)) - 1 / len(values)
    best, result = np.inf, values
    for kernel in kernels:
        sizes, vectors = np.linalg.eigh(center @ kernel @ center)
        sizes, vectors = sizes[1:].clip(0), vectors[:, 1:]  # the first is the mean's
        coefficients = vectors.T @ values
        for ratio in VARIANCE_RATIOS:
            spread = 1 + ratio * sizes
            variance = max((coefficients**2 / spread[:, None]).mean(), EPSILON**2)
            negative_log_likelihood = len(sizes) * np.log(variance) + np.log(spread).sum()
            if negative_log_likelihood < best:
                best, result = negative_log_likelihood, vectors @ (coefficients / spread[:, None])
    return result
