"""How each photo is exposed beside the others: gains of red, green and blue, from what photos show of the same places.

A render cannot tell: a field that has learned photos of several exposures explains them by colors that change with the
direction, and then agrees with each of them. Places can: half-learned geometry says where two photos show the same.
A gain in sRGB is close to one in linear light but for dark tones, and takes other white balances too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..capture.camera import Camera
from ..compute.neighbors import tree_of
from ..io.images import resize
from .extent import focus_point
from .rendering.rays import PixelDataset
from .scene import Scene


@dataclass(frozen=True)
class Parameters:
    """What tells a gain. Chosen on drawn tables and a garden, as they are and with known gains, the demo, and two real captures.

    Attributes:
        long_side: Pixels of the reduced photos that are compared.
        neighbors: Nearest cameras with which each photo is compared: farther ones see other gloss.
        solid: Opacity from which a pixel shows a place.
        same: Share of its distance within which two photos show one place.
        darkest: sRGB; what is dark is noise.
        brightest: sRGB; what is clipped tells no gain.
        fewest: Places that tell of a pair.
        outlier: Typical errors from which a pair counts less (Huber).
        photos: Of fewer nothing is told.
        cells: Along the longest side of what is seen; places fall into two halves as on a chessboard.
        agreement: Correlation of what either half tells from which it is believed. With known gains it is 0.99; real
            captures whose geometry is poor have 0.7, and gain nothing.
        least: Deviation of logarithms of gains from which they are worth having; with 0.007 nothing was won.
    """

    long_side: int = 64
    neighbors: int = 16
    solid: float = 0.8
    same: float = 0.04
    darkest: float = 0.06
    brightest: float = 0.94
    fewest: int = 40
    outlier: float = 1.5
    photos: int = 8
    cells: int = 6
    agreement: float = 0.9
    least: float = 0.02


PARAMETERS = Parameters()
REACHES = (2.0, 4.0, 8.0)  # of gloss, in distances from camera to camera, as directions
SHARES = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)  # variances of it for one of what differs by chance
ROUNDS = 10  # of weighting pairs by their errors
SMALL = 1e-9


def photo_gains(scene: Scene, dataset: PixelDataset, parameters: Parameters = PARAMETERS) -> np.ndarray:
    """How each photo is exposed beside the others, as far as it is believed.

    Args:
        scene: As far as it is learned; only its geometry counts.
        dataset: Its training images.
        parameters: What tells.

    Returns:
        [V, 3] float32 with the geometric mean 1; exactly 1 where photos agree, or too little says how they differ.
    """
    cameras = dataset.cameras
    if len(cameras) < parameters.photos:
        return np.ones((len(cameras), 3), np.float32)
    looks = [_look(scene, dataset, number, parameters) for number in range(len(cameras))]
    pairs = list(_compared(looks, parameters))
    every, *halves = (
        without_gloss(_explained(medians, len(cameras), parameters.outlier), cameras)
        for medians in _medians(pairs, parameters.fewest)
    )
    return believed(every, *halves, parameters)


def gains_beside(
    scene: Scene, camera: Camera, photo: np.ndarray, parameters: Parameters = PARAMETERS
) -> tuple[float, float, float]:
    """How a photo that a scene was not learned from is exposed beside those that it was: by the scene as it shows it.

    Args:
        scene: Learned of photos in their mean exposure.
        camera: The photo's, a pinhole.
        photo: sRGB [H, W, 3] in [0, 1].
        parameters: What tells.

    Returns:
        Red, green and blue; 1 of what too few pixels tell.
    """
    camera = camera.reduced(parameters.long_side)
    picture = scene.render(camera, 1)
    is_solid = picture.opacity.cpu().numpy() > parameters.solid
    own = resize(photo, camera.width, camera.height)[is_solid]
    ratios = _log_ratios(own, picture.color.cpu().numpy()[is_solid], parameters)
    told = [channel[~np.isnan(channel)] for channel in ratios.T]
    return tuple(float(np.exp(np.median(each))) if len(each) >= parameters.fewest else 1.0 for each in told)


def believed(every: np.ndarray, half: np.ndarray, other: np.ndarray, parameters: Parameters = PARAMETERS) -> np.ndarray:
    """Gains of logarithms that all places tell, as far as two halves of these agree (Spearman 1910, Brown 1910).

    Args:
        every: [V, 3].
        half: What one half of the places tells, likewise.
        other: What the other half tells.
        parameters: What tells.

    Returns:
        [V, 3] float32.

    Examples:
        >>> logs = np.array([[0.1] * 3, [-0.1] * 3])
        >>> believed(logs, logs, logs)[:, 0].round(3).tolist()
        [1.1050000190734863, 0.9049999713897705]
        >>> believed(logs, logs, -logs).tolist()
        [[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]
    """
    agreement = 2 * (half * other).mean() / max((half**2).mean() + (other**2).mean(), SMALL)
    logs = every * (2 * agreement / (1 + agreement) if agreement > parameters.agreement else 0)
    if logs.std() < parameters.least:
        return np.ones(every.shape, np.float32)
    return np.exp(logs - logs.mean(0)).astype(np.float32)


@dataclass(frozen=True)
class _Look:
    """A reduced photo [H, W, 3], and where its pixels end: places [H * W, 3], world, and distances, 0 where open."""

    camera: Camera
    photo: np.ndarray
    places: np.ndarray
    distances: np.ndarray


@dataclass(frozen=True)
class _Pair:
    """What two photos show of the same n places.

    ratios: logarithms of the first by the second, [n, 3], NaN where one is clipped or dark. half: bool [n], in which
    half of the world each place lies.
    """

    first: int
    second: int
    ratios: np.ndarray
    half: np.ndarray


def _look(scene: Scene, dataset: PixelDataset, number: int, parameters: Parameters) -> _Look:
    camera = dataset.cameras[number].reduced(parameters.long_side)
    picture = scene.render(camera, 1)
    origins, directions = camera.rays(camera.pixel_centers())
    steps = picture.depth.cpu().numpy().reshape(-1, 1) * directions
    is_solid = picture.opacity.cpu().numpy().ravel() > parameters.solid
    photo = resize(dataset.picture(number), camera.width, camera.height)
    return _Look(camera, photo, origins + steps, np.where(is_solid, np.linalg.norm(steps, axis=1), 0))


def _compared(looks: Sequence[_Look], parameters: Parameters) -> Iterator[_Pair]:
    """Each photo with its nearest neighbors."""
    places = np.concatenate([look.places[look.distances > 0] for look in looks])
    if not len(places):
        return
    low, high = np.quantile(places, (0.02, 0.98), axis=0)
    cell = (high - low).max() / parameters.cells
    positions = np.stack([look.camera.position for look in looks])
    _, nearest = tree_of(positions).query(positions, min(parameters.neighbors + 1, len(looks)))
    for number, look in enumerate(looks):
        half = np.floor((look.places - low) / max(cell, SMALL)).sum(1) % 2 == 1
        for other in nearest[number]:
            if other != number:
                pixels, ratios = _ratios(look, looks[other], parameters)
                yield _Pair(number, int(other), ratios, half[pixels])


def _ratios(look: _Look, other: _Look, parameters: Parameters) -> tuple[np.ndarray, np.ndarray]:
    """Numbers [n] of the pixels of a look whose places the other one shows too, and logarithms of their colors by its, [n, 3]."""
    width, height = other.camera.width, other.camera.height
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels, depth = other.camera.project(look.places)
    inside = (pixels >= 0.5).all(1) & (pixels <= (width - 0.5, height - 0.5)).all(1)
    shown = np.flatnonzero((look.distances > 0) & (depth > 0) & inside)
    column, row = pixels[shown].astype(int).T
    distance = np.linalg.norm(look.places[shown] - other.camera.position, axis=1)
    shown = shown[np.abs(other.distances[row * width + column] - distance) < parameters.same * distance]
    if not len(shown):
        return shown, np.empty((0, 3))
    at = np.float32(pixels[shown] - 0.5)
    color = cv2.remap(other.photo, at[:, :1], at[:, 1:], cv2.INTER_LINEAR)[:, 0]
    return shown, _log_ratios(look.photo.reshape(-1, 3)[shown], color, parameters)


def _log_ratios(own: np.ndarray, other: np.ndarray, parameters: Parameters) -> np.ndarray:
    """Logarithms of colors [n, 3] by others, NaN where one is clipped or dark."""
    told = (np.minimum(own, other) > parameters.darkest) & (np.maximum(own, other) < parameters.brightest)
    return np.log(np.where(told, own, np.nan) / np.where(told, other, 1))


def _medians(pairs: Sequence[_Pair], fewest: int) -> tuple[list[list[tuple]], ...]:
    """Of each channel what pairs say, (first, second, median, count): of all places, and of either half of them."""
    found = tuple([[] for _ in range(3)] for _ in range(3))
    for pair in pairs:
        for kind, chosen in enumerate((slice(None), pair.half, ~pair.half)):
            for channel, ratios in enumerate(pair.ratios[chosen].T):
                told = ratios[~np.isnan(ratios)]
                if len(told) >= fewest:
                    found[kind][channel].append((pair.first, pair.second, np.median(told), len(told)))
    return found


def _explained(said: Sequence[Sequence[tuple]], count: int, outlier: float) -> np.ndarray:
    """Logarithms [V, 3] with mean 0 whose differences are nearest to the pairs' medians, see `_medians`."""
    return np.stack([_explained_channel(np.array(each).reshape(-1, 4), count, outlier) for each in said], 1)


def _explained_channel(said: np.ndarray, count: int, outlier: float) -> np.ndarray:
    if not len(said):
        return np.zeros(count)
    first, second = said[:, :2].astype(int).T
    system = np.zeros((len(said), count))
    system[np.arange(len(said)), first] = 1
    system[np.arange(len(said)), second] = -1
    weights, trust = said[:, 3] / said[:, 3].mean(), np.ones(len(said))
    alike = 1e-6 * np.eye(count)  # what no pair tells of is exposed as the mean
    for _ in range(ROUNDS):
        rows = system * (weights * trust)[:, None]
        logs = np.linalg.solve(system.T @ rows + alike, rows.T @ said[:, 2])
        errors = np.abs(system @ logs - said[:, 2])
        trust = np.minimum(1, outlier * 1.4826 * np.median(errors) / np.maximum(errors, SMALL))
    return logs - logs.mean()


def without_gloss(logs: np.ndarray, cameras: Sequence[Camera]) -> np.ndarray:
    """What of logarithms does not change smoothly with the direction of the camera, as gloss and a sky do.

    They are a part that differs from photo to photo by chance and a Gaussian process of the direction; how large both are
    and how far the smooth one reaches is what makes the logarithms likeliest, for brightness and tint apart. The first
    part's mean is returned, given their sum (Rasmussen and Williams 2006).

    Args:
        logs: [V, 3] with mean 0.
        cameras: V of them.

    Returns:
        [V, 3].
    """
    towards = np.stack([camera.position for camera in cameras]) - focus_point(list(cameras)).numpy()
    towards /= np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), SMALL)
    apart = np.linalg.norm(towards[:, None] - towards, axis=2)
    spacing = np.median((apart + 9 * np.eye(len(apart))).min(1))
    likenesses = [np.exp(-0.5 * (apart / max(reach * spacing, SMALL)) ** 2) for reach in REACHES]
    brightness = logs.mean(1, keepdims=True)
    return _by_chance(brightness, likenesses) + _by_chance(logs - brightness, likenesses)


def _by_chance(values: np.ndarray, likenesses: Sequence[np.ndarray]) -> np.ndarray:
    """The part of values [V, n] that is no Gaussian process; likenesses: its possible correlations [V, V]."""
    center = np.eye(len(values)) - 1 / len(values)
    best, result = np.inf, values
    for likeness in likenesses:
        sizes, vectors = np.linalg.eigh(center @ likeness @ center)
        sizes, vectors = sizes[1:].clip(0), vectors[:, 1:]  # the first is the mean's
        found = vectors.T @ values
        for share in SHARES:
            spread = 1 + share * sizes
            variance = max((found**2 / spread[:, None]).mean(), SMALL**2)
            unlikely = len(sizes) * np.log(variance) + np.log(spread).sum()
            if unlikely < best:
                best, result = unlikely, vectors @ (found / spread[:, None])
    return result
