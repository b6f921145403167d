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


@dataclass(frozen=True)
class Parameters:
    """Constants of the estimate."""

    long_side: int = 64  # pixels of the reduced photos
    neighbors: int = 16  # nearest cameras that each photo is compared with; farther ones see other highlights
    min_opacity: float = 0.8  # of a pixel on a surface
    depth_tolerance: float = 0.04  # difference between two photos of the same point, share of the distance
    darkest: float = 0.06  # sRGB; darker pixels are noise
    brightest: float = 0.94  # sRGB; brighter pixels may be clipped
    min_points: int = 40  # shared points of a pair of photos
    outlier: float = 1.5  # typical errors beyond which a pair gets less weight (Huber)
    min_photos: int = 8  # fewer photos get gains of 1
    cells: int = 6  # along the longest side of the scene; a checkerboard splits the points into halves
    min_reliability: float = 0.9  # correlation of the two halves' log gains below which gains are 1
    min_deviation: float = 0.02  # standard deviation of log gains below which gains are 1


PARAMETERS = Parameters()
REACHES = (2.0, 4.0, 8.0)  # length scales of view-dependent effects, in distances between cameras
VARIANCE_RATIOS = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)  # view-dependent to independent variance
ITERATIONS = 10  # of reweighted least squares
EPSILON = 1e-9


def estimate_photo_gains(scene: Scene, dataset: PixelDataset) -> np.ndarray:
    """Estimate the gain of each photo of the dataset from the geometry of a partly learned scene.

    Returns:
        [V, 3] float32 with a geometric mean of 1; exactly 1 where photos agree or the estimate is unreliable.
    """
    cameras = dataset.cameras
    if len(cameras) < PARAMETERS.min_photos:
        return np.ones((len(cameras), 3), np.float32)
    samples = [_sample_view(scene, dataset, number) for number in range(len(cameras))]
    medians, half, other = (
        remove_view_dependence(_log_gains(each, len(cameras)), cameras) for each in _medians(list(_pairs(samples)))
    )
    return shrunk_gains(medians, half, other)


def gains_from_render(scene: Scene, camera: Camera, photo: np.ndarray) -> tuple[float, float, float]:
    """Estimate the gains of a photo that the scene was not learned from, by comparison with a render.

    Args:
        scene: Learned from photos at their mean exposure.
        camera: The photo's, a pinhole.
        photo: sRGB [H, W, 3] in [0, 1].

    Returns:
        Red, green and blue; 1 for channels with too few pixels.
    """
    camera = camera.reduced(PARAMETERS.long_side)
    picture = scene.render(camera, 1)
    is_solid = picture.opacity.cpu().numpy() > PARAMETERS.min_opacity
    own = resize(photo, camera.width, camera.height)[is_solid]
    ratios = _log_ratios(own, picture.color.cpu().numpy()[is_solid])

    def gain(log_ratios: np.ndarray) -> float:
        known = log_ratios[~np.isnan(log_ratios)]
        return float(np.exp(np.median(known))) if len(known) >= PARAMETERS.min_points else 1.0

    red, green, blue = ratios.T
    return gain(red), gain(green), gain(blue)


def shrunk_gains(log_gains: np.ndarray, half: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Turn log gains [V, 3] into gains, shrunk by their split-half reliability (Spearman 1910, Brown 1910).

    Examples:
        >>> logs = np.array([[0.1] * 3, [-0.1] * 3])
        >>> shrunk_gains(logs, logs, logs)[:, 0].round(3).tolist()
        [1.1050000190734863, 0.9049999713897705]
        >>> shrunk_gains(logs, logs, -logs).tolist()
        [[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]
    """
    correlation = 2 * (half * other).mean() / max((half**2).mean() + (other**2).mean(), EPSILON)
    logs = log_gains * (2 * correlation / (1 + correlation) if correlation > PARAMETERS.min_reliability else 0)
    if logs.std() < PARAMETERS.min_deviation:
        return np.ones(log_gains.shape, np.float32)
    return np.exp(logs - logs.mean(0)).astype(np.float32)


@dataclass(frozen=True)
class _ViewSample:
    """A reduced photo [H, W, 3], with the surface points [H * W, 3] of its pixels and their distances, 0 if open."""

    camera: Camera
    photo: np.ndarray
    points: np.ndarray
    distances: np.ndarray


@dataclass(frozen=True)
class _Pair:
    """Log color ratios [n, 3] of two photos at n shared points, NaN where unusable, and their checkerboard half [n]."""

    first: int
    second: int
    ratios: np.ndarray
    half: np.ndarray


def _sample_view(scene: Scene, dataset: PixelDataset, number: int) -> _ViewSample:
    camera = dataset.cameras[number].reduced(PARAMETERS.long_side)
    picture = scene.render(camera, 1)
    origins, directions = camera.rays(camera.pixel_centers())
    steps = picture.depth.cpu().numpy().reshape(-1, 1) * directions
    is_solid = picture.opacity.cpu().numpy().ravel() > PARAMETERS.min_opacity
    photo = resize(dataset.image(number), camera.width, camera.height)
    return _ViewSample(camera, photo, origins + steps, np.where(is_solid, np.linalg.norm(steps, axis=1), 0))


def _pairs(samples: Sequence[_ViewSample]) -> Iterator[_Pair]:
    """Pair each photo with its nearest neighbors."""
    points = np.concatenate([sample.points[sample.distances > 0] for sample in samples])
    if not len(points):
        return
    low, high = np.quantile(points, np.array([0.02, 0.98]), axis=0)
    cell = (high - low).max() / PARAMETERS.cells
    positions = np.stack([sample.camera.position for sample in samples])
    _, nearest = build_kd_tree(positions).query(positions, min(PARAMETERS.neighbors + 1, len(samples)))
    for number, sample in enumerate(samples):
        half = np.floor((sample.points - low) / max(cell, EPSILON)).sum(1) % 2 == 1
        for other in nearest[number]:
            if other != number:
                pixels, ratios = _ratios(sample, samples[other])
                yield _Pair(number, int(other), ratios, half[pixels])


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
    shared = shared[error < PARAMETERS.depth_tolerance * distance]
    if not len(shared):
        return shared, np.empty((0, 3))
    at = (pixels[shared] - 0.5).astype(np.float32)
    color = cv2.remap(other.photo, at[:, :1], at[:, 1:], cv2.INTER_LINEAR)[:, 0]
    return shared, _log_ratios(sample.photo.reshape(-1, 3)[shared], color)


def _log_ratios(own: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return log(own / other) of colors [n, 3], NaN where one is clipped or dark."""
    usable = (np.minimum(own, other) > PARAMETERS.darkest) & (np.maximum(own, other) < PARAMETERS.brightest)
    return np.log(np.where(usable, own, np.nan) / np.where(usable, other, 1))


def _medians(pairs: Sequence[_Pair]) -> tuple[list[list[tuple]], ...]:
    """Return (first, second, median, count) of the pairs of each channel: of all points and of either half."""
    found = tuple([[] for _ in range(3)] for _ in range(3))
    for pair in pairs:
        for kind, chosen in enumerate((slice(None), pair.half, ~pair.half)):
            for channel, ratios in enumerate(pair.ratios[chosen].T):
                known = ratios[~np.isnan(ratios)]
                if len(known) >= PARAMETERS.min_points:
                    found[kind][channel].append((pair.first, pair.second, np.median(known), len(known)))
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
        trust = np.minimum(1, PARAMETERS.outlier * 1.4826 * np.median(errors) / np.maximum(errors, EPSILON))
    return logs - logs.mean()


def remove_view_dependence(logs: np.ndarray, cameras: Sequence[Camera]) -> np.ndarray:
    """Remove the part of log gains [V, 3] that varies smoothly with the camera's direction, as highlights and skies do.

    The model is independent noise plus a Gaussian process of the direction, with maximum-likelihood variances and
    length scale, separately for brightness and tint. Returns the posterior mean of the independent part (Rasmussen and
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
