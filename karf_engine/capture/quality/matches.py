"""What neighboring photos share: features matched between them, checked by the cameras, and placed in space.

Features are SIFT's (Lowe 2004), as OpenCV finds them. A match counts where both cameras see it in front of them, and its
two rays meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...io.color import srgb_to_linear
from ..camera import Camera

FEATURES = 600  # of a photo
CONTRAST = 0.02  # of the weakest feature: half of OpenCV's, as small photos have few
DISTINCT = 0.8  # how much nearer than the second best a match must be (Lowe 2004)
NEAR = 2.0  # pixels within which two rays meet
LEAST_ANGLE = 0.5  # degrees between rays below which a place is unknown
FEW = 5  # matches of a pair below which nothing is told of its exposures
TOLD = (0.02, 0.9)  # linear light: darker is noise, brighter is clipped


@dataclass(frozen=True)
class Matches:
    """What pairs of photos share.

    Attributes:
        points: [m, 3] float64, world.
        errors: [m] float64, pixels by which the rays miss each other.
        tried: [p], how many features of each pair look alike.
        agreed: [p], how many of these the cameras agree with.
        stops: [p, 3] float64, by how many stops the second photo of a pair is brighter in red, green and blue; nan
            where too few are shared.
    """

    points: np.ndarray
    errors: np.ndarray
    tried: np.ndarray
    agreed: np.ndarray
    stops: np.ndarray


def match_neighbors(
    pictures: Sequence[np.ndarray], cameras: Sequence[Camera], pairs: Sequence[tuple[int, int]]
) -> Matches:
    """Match the features of each pair.

    Args:
        pictures: uint8 [H, W, 3] each.
        cameras: Pinholes of these sizes.
        pairs: Numbers of photos.
    """
    features = [_features(picture) for picture in pictures]
    found = [_match_pair(*((pictures[n], cameras[n], *features[n]) for n in pair)) for pair in pairs]
    points, errors, tried, stops = zip(*found, strict=True) if found else ((), (), (), ())
    return Matches(
        np.concatenate([np.empty((0, 3)), *points]),
        np.concatenate([np.empty(0), *errors]),
        np.array(tried, np.int64),
        np.array([len(each) for each in points], np.int64),
        np.array(stops).reshape(-1, 3),
    )


def _features(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Where features are, [n, 2], and what they look like, [n, 128]."""
    finder = cv2.SIFT_create(FEATURES, contrastThreshold=CONTRAST)
    found, looks = finder.detectAndCompute(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), None)
    return np.array([each.pt for each in found], np.float64).reshape(-1, 2) + 0.5, looks


def _match_pair(first: tuple, second: tuple) -> tuple[np.ndarray, np.ndarray, int, np.ndarray]:
    """Points, errors, number of matches tried, and stops of one pair; each side is picture, camera, pixels, looks."""
    (picture_a, camera_a, pixels_a, looks_a), (picture_b, camera_b, pixels_b, looks_b) = first, second
    nothing = np.full(3, np.nan)
    if min(len(pixels_a), len(pixels_b)) < 2:  # the second best is looked at too
        return np.empty((0, 3)), np.empty(0), 0, nothing
    both = cv2.BFMatcher().knnMatch(looks_a, looks_b, k=2)
    good = [best for best, other in both if best.distance < DISTINCT * other.distance]
    pixels_a = pixels_a[[each.queryIdx for each in good]]
    pixels_b = pixels_b[[each.trainIdx for each in good]]
    if not good:
        return np.empty((0, 3)), np.empty(0), 0, nothing
    points, is_told = meeting_points(camera_a, camera_b, pixels_a, pixels_b)
    misses = [np.linalg.norm(camera.project(points)[0] - pixels, axis=1)
              for camera, pixels in ((camera_a, pixels_a), (camera_b, pixels_b))]  # fmt: skip
    errors = np.maximum(*misses)
    kept = is_told & (errors < NEAR)
    stops = _stops(_light(picture_a, pixels_a[kept]), _light(picture_b, pixels_b[kept]))
    return points[kept], errors[kept], len(good), stops


def meeting_points(
    camera_a: Camera, camera_b: Camera, pixels_a: np.ndarray, pixels_b: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where the rays of two cameras come nearest to each other.

    Args:
        camera_a: The first pinhole.
        camera_b: The second.
        pixels_a: [m, 2].
        pixels_b: [m, 2].

    Returns:
        Points [m, 3] float64, world; and whether each lies before both cameras, seen under an angle, bool [m].
    """
    (start_a, along_a), (start_b, along_b) = camera_a.rays(pixels_a), camera_b.rays(pixels_b)
    along_a, along_b = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in (along_a, along_b))
    apart, cosine = start_a - start_b, (along_a * along_b).sum(1)
    on_a, on_b = (along_a * apart).sum(1), (along_b * apart).sum(1)
    sine2 = 1 - cosine**2 + 1e-12
    far_a, far_b = (cosine * on_b - on_a) / sine2, (on_b - cosine * on_a) / sine2
    points = (start_a + far_a[:, None] * along_a + start_b + far_b[:, None] * along_b) / 2
    return points, (far_a > 0) & (far_b > 0) & (sine2 > np.sin(np.radians(LEAST_ANGLE)) ** 2)


def _light(picture: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Linear light at pixels, [m, 3]."""
    height, width = picture.shape[:2]
    column, row = pixels[:, 0].astype(int).clip(0, width - 1), pixels[:, 1].astype(int).clip(0, height - 1)
    return srgb_to_linear(cv2.GaussianBlur(picture, (0, 0), 1.0)[row, column] / 255)


def _stops(light_a: np.ndarray, light_b: np.ndarray) -> np.ndarray:
    """Median difference in stops, [3]; nan where too few pixels are told."""
    told = ((light_a > TOLD[0]) & (light_a < TOLD[1]) & (light_b > TOLD[0]) & (light_b < TOLD[1])).all(1)
    if told.sum() < FEW:
        return np.full(3, np.nan)
    return np.median(np.log2(light_b[told] / light_a[told]), axis=0)


def exposures(count: int, pairs: Sequence[tuple[int, int]], stops: np.ndarray) -> np.ndarray:
    """Each photo's exposure in stops, [n, 3] with mean 0: what explains the pairs' differences best.

    Args:
        count: n, how many photos there are.
        pairs: Numbers of photos.
        stops: As of `Matches`.

    Examples:
        >>> exposures(3, [(0, 1), (1, 2)], np.array([[1.0] * 3, [-1.0] * 3]))[:, 0].round(2).tolist()
        [-0.33, 0.67, -0.33]
    """
    known = [(pair, row) for pair, row in zip(pairs, stops, strict=True) if np.isfinite(row).all()]
    rows = np.zeros((len(known) + count, count))
    for number, ((a, b), _) in enumerate(known):
        rows[number, b], rows[number, a] = 1.0, -1.0
    rows[len(known) :] = 1e-3 * np.eye(count)  # photos without a pair are like the others
    wanted = np.concatenate([np.reshape([row for _, row in known], (-1, 3)), np.zeros((count, 3))])
    found = np.linalg.lstsq(rows, wanted, rcond=None)[0]
    return found - found.mean(0)
