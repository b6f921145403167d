"""Match SIFT features (Lowe 2004) between neighboring photos and verify them by the cameras.

A match agrees with the cameras if its two rays meet in front of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...io.color import srgb_to_linear
from ..camera import Camera

FEATURES = 600  # per photo
CONTRAST = 0.02  # half of OpenCV's default, since small photos have few features
LOWE_RATIO = 0.8  # distance of the best match over the second best (Lowe 2004)
NEAR = 2.0  # largest reprojection error of an agreeing match, pixels
LEAST_ANGLE = 0.5  # smallest angle between rays, degrees
FEW = 5  # agreeing matches needed for a pair's exposure
EXPOSED = (0.02, 0.9)  # range of linear light between noise and clipping


@dataclass(frozen=True)
class Matches:
    """Matches of the pairs of photos.

    Attributes:
        points: Triangulated points of agreeing matches, [m, 3] float64, world.
        errors: Their reprojection errors, [m] float64, pixels.
        tried: Number of matched features of each pair, [p].
        agreed: Number of these that agree with the cameras, [p].
        stops: Stops by which the second photo of a pair is brighter in red, green and blue, [p, 3] float64; nan for
            pairs with few agreeing matches.
    """

    points: np.ndarray
    errors: np.ndarray
    tried: np.ndarray
    agreed: np.ndarray
    stops: np.ndarray


def match_neighbors(
    pictures: Sequence[np.ndarray], cameras: Sequence[Camera], pairs: Sequence[tuple[int, int]]
) -> Matches:
    """Match the features of each pair of photos, uint8 [H, W, 3] of pinhole cameras."""
    features = [_features(picture) for picture in pictures]
    matched = [_match_pair(*((pictures[n], cameras[n], *features[n]) for n in pair)) for pair in pairs]
    points, errors, tried, stops = zip(*matched, strict=True) if matched else ((), (), (), ())
    return Matches(
        np.concatenate([np.empty((0, 3)), *points]),
        np.concatenate([np.empty(0), *errors]),
        np.array(tried, np.int64),
        np.array([len(each) for each in points], np.int64),
        np.array(stops).reshape(-1, 3),
    )


def _features(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Return positions [n, 2] and descriptors [n, 128] of the features."""
    sift = cv2.SIFT_create(FEATURES, contrastThreshold=CONTRAST)  # pyright: ignore[reportAttributeAccessIssue]
    keypoints, descriptors = sift.detectAndCompute(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), None)
    return np.array([each.pt for each in keypoints], np.float64).reshape(-1, 2) + 0.5, descriptors


def _match_pair(first: tuple, second: tuple) -> tuple[np.ndarray, np.ndarray, int, np.ndarray]:
    """Return points, errors, number of matches and stops of a pair; each side is (picture, camera, pixels, descriptors)."""
    (picture_a, camera_a, pixels_a, descriptors_a), (picture_b, camera_b, pixels_b, descriptors_b) = first, second
    good = []
    if min(len(pixels_a), len(pixels_b)) >= 2:  # the ratio test needs two neighbors
        neighbors = cv2.BFMatcher().knnMatch(descriptors_a, descriptors_b, k=2)
        good = [best for best, other in neighbors if best.distance < LOWE_RATIO * other.distance]
    if not good:
        return np.empty((0, 3)), np.empty(0), 0, np.full(3, np.nan)
    pixels_a = pixels_a[[each.queryIdx for each in good]]
    pixels_b = pixels_b[[each.trainIdx for each in good]]
    points, is_valid = _intersect_rays(camera_a, camera_b, pixels_a, pixels_b)
    error_a = np.linalg.norm(camera_a.project(points)[0] - pixels_a, axis=1)
    error_b = np.linalg.norm(camera_b.project(points)[0] - pixels_b, axis=1)
    errors = np.maximum(error_a, error_b)
    kept = is_valid & (errors < NEAR)
    stops = _stops(_light(picture_a, pixels_a[kept]), _light(picture_b, pixels_b[kept]))
    return points[kept], errors[kept], len(good), stops


def _intersect_rays(
    camera_a: Camera, camera_b: Camera, pixels_a: np.ndarray, pixels_b: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the points [m, 3] nearest to both rays, and whether they are in front of both cameras, bool [m]."""
    (start_a, along_a), (start_b, along_b) = camera_a.rays(pixels_a), camera_b.rays(pixels_b)
    along_a, along_b = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (along_a, along_b))
    apart, cosine = start_a - start_b, (along_a * along_b).sum(1)
    on_a, on_b = (along_a * apart).sum(1), (along_b * apart).sum(1)
    sine2 = 1 - cosine**2 + 1e-12
    far_a, far_b = (cosine * on_b - on_a) / sine2, (on_b - cosine * on_a) / sine2
    points = (start_a + far_a[:, None] * along_a + start_b + far_b[:, None] * along_b) / 2
    return points, (far_a > 0) & (far_b > 0) & (sine2 > np.sin(np.radians(LEAST_ANGLE)) ** 2)


def _light(picture: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Return the smoothed linear light at pixels, [m, 3]."""
    height, width = picture.shape[:2]
    column, row = pixels[:, 0].astype(int).clip(0, width - 1), pixels[:, 1].astype(int).clip(0, height - 1)
    return srgb_to_linear(cv2.GaussianBlur(picture, (0, 0), 1.0)[row, column] / 255)


def _stops(light_a: np.ndarray, light_b: np.ndarray) -> np.ndarray:
    """Return the median difference in stops, [3]; nan if too few pixels are well exposed."""
    low, high = EXPOSED
    usable = ((light_a > low) & (light_a < high) & (light_b > low) & (light_b < high)).all(1)
    if usable.sum() < FEW:
        return np.full(3, np.nan)
    return np.median(np.log2(light_b[usable] / light_a[usable]), axis=0)


def exposures(count: int, pairs: Sequence[tuple[int, int]], stops: np.ndarray) -> np.ndarray:
    """Estimate the exposures in stops with mean 0, [count, 3], by least squares over the pairs' differences `stops`.

    Examples:
        >>> exposures(3, [(0, 1), (1, 2)], np.array([[1.0] * 3, [-1.0] * 3]))[:, 0].round(2).tolist()
        [-0.33, 0.67, -0.33]
    """
    known = [(pair, row) for pair, row in zip(pairs, stops, strict=True) if np.isfinite(row).all()]
    rows = np.zeros((len(known) + count, count))
    for number, ((a, b), _) in enumerate(known):
        rows[number, b], rows[number, a] = 1.0, -1.0
    rows[len(known) :] = 1e-3 * np.eye(count)  # regularizes photos without a pair
    differences = np.concatenate([np.reshape([row for _, row in known], (-1, 3)), np.zeros((count, 3))])
    solution = np.linalg.lstsq(rows, differences, rcond=None)[0]
    return solution - solution.mean(0)
