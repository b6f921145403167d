"""Measure a capture before training: sharpness, exposure, camera placement and agreement of matches.

SIFT features (Lowe 2004) are matched between neighboring photos. A match agrees with the cameras if its two rays meet in
front of both.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..errors import DataError
from ..io.color import srgb_to_linear, to_bytes
from ..io.images import alpha_composite, embedded_space, read_mask, resize
from .camera import Camera
from .capture import Capture, View, masks_of_view
from .placement import Placement, measure_placement, seen_by_few
from .sparse_points import reprojection_errors, summarize
from .training_images import load_views
from .triangulation import neighbor_pairs

SIDE = 400  # longer side of the inspected photos, pixels
MOST_PHOTOS = 150  # photos opened at most, evenly spaced; all cameras are used
NEIGHBORS = 4  # photos compared with each photo
FEWEST = 3  # photos
FINE, COARSE = 1.0, 3.0  # Gaussian scales of the detail bands, pixels
VOXELS = 160  # approximate voxels across an image with preset `demo`
THIN = 3  # narrower parts are thin, pixels
FEATURES = 600  # per photo
CONTRAST = 0.02  # half of OpenCV's default, since small photos have few features
LOWE_RATIO = 0.8  # distance of the best match over the second best (Lowe 2004)
NEAR = 2.0  # largest reprojection error of an agreeing match, pixels
LEAST_ANGLE = 0.5  # smallest angle between rays, degrees
FEW = 5  # agreeing matches needed for a pair's exposure
BLURRED = 0.65  # sharpness relative to neighboring photos
EXPOSED = (0.02, 0.9)  # range of linear light between noise and clipping


@dataclass(frozen=True)
class Inspection:
    """Figures of a capture's photos and cameras; shares are in [0, 1]."""

    views: tuple[str, ...]  # names of the training photos
    opened: tuple[int, ...]  # indices of the opened photos
    placement: Placement  # of all cameras
    sharpness: np.ndarray  # of the opened photos relative to their neighbors, [o]
    exposures: np.ndarray  # stops of red, green and blue of the opened photos relative to the mean, [o, 3]
    plainness: float  # see `_plainness`, dB
    is_matte: bool  # all opened photos have an alpha matte
    agreed: float  # share of the matches between neighboring photos that agree with the cameras
    poor_pairs: float  # share of the pairs with few agreeing matches
    # median error in pixels: of sparse points in the photo as stored, else of matches at `SIDE` pixels; nan without any
    reprojection: float
    seen_by_few: float  # share of the visible scene in at most two photos
    thin: Mapping[str, float]  # share of each masked object that is thinner than `THIN` pixels
    profiles: Mapping[str, int]  # number of opened photos in each color profile but sRGB, by its name

    @property
    def blurred(self) -> list[str]:
        """Names of the opened photos that are less sharp than their neighbors, the worst first."""
        order = np.argsort(self.sharpness)
        return [self.views[self.opened[n]] for n in order if self.sharpness[n] < BLURRED]

    def to_json(self) -> dict[str, Any]:
        """Return the figures as JSON values, null if unknown."""
        place, names = self.placement, [self.views[n] for n in self.opened]
        width, _ = place.hole
        return {
            "photos": len(self.views),
            "is_of_one_side": place.is_open,
            "spacing_degrees": round(place.spacing, 2),
            "widest_hole_degrees": round(width, 1),
            "sharpness": dict(zip(names, self.sharpness.round(3).tolist(), strict=True)),
            "blurred": self.blurred,
            "color_profiles": dict(self.profiles),
            "exposure_stops": dict(zip(names, self.exposures.round(3).tolist(), strict=True)),
            "plainness_db": round(self.plainness, 2),
            "is_matte": self.is_matte,
            "matches_agreed": round(self.agreed, 3),
            "pairs_that_share_little": round(self.poor_pairs, 3),
            "reprojection_pixels": round(self.reprojection, 3) if np.isfinite(self.reprojection) else None,
            "seen_by_few": round(self.seen_by_few, 3),
            "thin": {name: round(share, 3) for name, share in self.thin.items()},
        }


def inspect_capture(capture: Capture, masks: Path | None = None) -> Inspection:
    """Inspect the training photos of a capture, and rough masks in MASKS/<object>/<photo stem>.png.

    Raises DataError if there are too few photos, or one is missing or damaged.
    """
    views = capture.split("train")
    if len(views) < FEWEST:
        raise DataError(
            "{path} has {count} photos to learn from.",
            "Give a capture with {fewest} or more: some 30 from all sides.",
            path=capture.source,
            count=len(views),
            fewest=FEWEST,
        )
    step = max(1, -(-len(views) // MOST_PHOTOS))
    opened = tuple(range(0, len(views), step))
    images = load_views([views[n] for n in opened], SIDE)
    cameras = [image.camera for image in images]
    pictures = [to_bytes(alpha_composite(image.color, image.alpha)) for image in images]
    pairs = neighbor_pairs(cameras, NEIGHBORS)
    found = _match_neighbors(pictures, cameras, pairs)
    placement = measure_placement([view.camera for view in views], found.points)
    return Inspection(
        views=tuple(view.name for view in views),
        opened=opened,
        placement=placement,
        sharpness=_against_neighbors(np.array([_sharpness(each) for each in pictures]), pairs),
        exposures=solve_exposures(len(images), pairs, found.stops),
        plainness=_plainness(pictures),
        is_matte=all(image.alpha is not None for image in images),
        agreed=float(found.agreed.sum() / max(1, found.tried.sum())),
        poor_pairs=float((found.agreed < FEW).mean()),
        reprojection=_reprojection(capture, views, found),
        seen_by_few=seen_by_few(cameras, placement.center),
        thin=dict(_thin_objects(masks, views)) if masks is not None else {},
        profiles=_profiles([image.view for image in images]),
    )


def _profiles(views: Sequence[View]) -> dict[str, int]:
    spaces = [embedded_space(view.image) for view in views if view.image is not None and view.space is None]
    return dict(Counter(space.name for space in spaces if space is not None))


def _reprojection(capture: Capture, views: Sequence[View], found: _Matches) -> float:
    if capture.points is None:
        return float(np.median(found.errors)) if len(found.errors) else float("nan")
    names = {view.name for view in views}
    numbers = [n for n, view in enumerate(capture.views) if view.name in names]
    summaries = [summarize(*reprojection_errors(capture, n)) for n in numbers]
    medians = [summary.median for summary in summaries if summary.count]
    return float(np.median(medians)) if medians else float("nan")


def _thin_objects(folder: Path, views: Sequence[View]) -> Iterator[tuple[str, float]]:
    """Yield the name of each masked object, and the share of its masks that is thin in photos of `SIDE` pixels."""
    for masks in sorted(each for each in folder.iterdir() if each.is_dir()):
        shares = [_thin_share(read_mask(path)) for view in views for path in masks_of_view(masks, view)[:1]]
        if shares:
            yield masks.name, float(np.mean(shares))


# ----------------------------------------------------------------------------------------------------- photos and masks
def _sharpness(picture: np.ndarray) -> float:
    """Return the ratio of fine to coarse detail of a photo, uint8 [H, W, 3], which falls with blur; 1 without detail."""
    gray = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY).astype(np.float32)
    fine, coarse = (cv2.GaussianBlur(gray, (0, 0), sigma) for sigma in (FINE, COARSE))
    return float(((gray - fine).std() + 1e-3) / ((fine - coarse).std() + 1e-3))


def _against_neighbors(values: np.ndarray, pairs: Sequence[tuple[int, int]]) -> np.ndarray:
    """Divide each photo's value by the median of its paired photos, [n]."""
    neighbors: list[list[float]] = [[] for _ in values]
    for a, b in pairs:
        neighbors[a].append(values[b])
        neighbors[b].append(values[a])
    return np.array([value / np.median(others or [value]) for value, others in zip(values, neighbors, strict=True)])


def _plainness(pictures: Sequence[np.ndarray]) -> float:
    """Return the PSNR in dB of photos blurred by a voxel's width against themselves: low for fine detail."""
    errors = []
    for picture in pictures:
        color = picture.astype(np.float32) / 255
        errors.append(((color - cv2.GaussianBlur(color, (0, 0), color.shape[1] / VOXELS)) ** 2).mean())
    return float(-10 * np.log10(np.mean(errors) + 1e-6))


def _thin_share(mask: np.ndarray) -> float:
    """Return the share of a mask in parts narrower than `THIN` pixels, scaled down to `SIDE` pixels."""
    height, width = mask.shape
    factor = min(1.0, SIDE / max(height, width))
    mask = resize(mask.astype(np.float32), max(1, round(width * factor)), max(1, round(height * factor))) >= 0.5
    area = int(np.count_nonzero(mask))
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((THIN, THIN), np.uint8))
    return 1 - int(np.count_nonzero(opened)) / area if area else 0.0


# -------------------------------------------------------------------------------------------------------------- matches
@dataclass(frozen=True)
class _Matches:
    """Matches of p pairs of photos."""

    points: np.ndarray  # triangulated points of agreeing matches, [m, 3] float64, world
    errors: np.ndarray  # their reprojection errors, [m] float64, pixels
    tried: np.ndarray  # number of matched features, [p]
    agreed: np.ndarray  # number of these that agree with the cameras, [p]
    stops: np.ndarray  # brightness of the second over the first photo, [p, 3] float64 RGB; nan if few matches agree


def _match_neighbors(
    pictures: Sequence[np.ndarray], cameras: Sequence[Camera], pairs: Sequence[tuple[int, int]]
) -> _Matches:
    """Match the features of each pair of photos, uint8 [H, W, 3] of pinhole cameras."""
    features = [_features(picture) for picture in pictures]
    matched = [_match_pair(*((pictures[n], cameras[n], *features[n]) for n in pair)) for pair in pairs]
    points, errors, tried, stops = zip(*matched, strict=True) if matched else ((), (), (), ())
    return _Matches(
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


def solve_exposures(count: int, pairs: Sequence[tuple[int, int]], stops: np.ndarray) -> np.ndarray:
    """Estimate the exposures in stops with mean 0, [count, 3], by least squares over the pairs' differences `stops`."""
    known = [(pair, row) for pair, row in zip(pairs, stops, strict=True) if np.isfinite(row).all()]
    rows = np.zeros((len(known) + count, count))
    for number, ((a, b), _) in enumerate(known):
        rows[number, b], rows[number, a] = 1.0, -1.0
    rows[len(known) :] = 1e-3 * np.eye(count)  # regularizes photos without a pair
    differences = np.concatenate([np.reshape([row for _, row in known], (-1, 3)), np.zeros((count, 3))])
    solution = np.linalg.lstsq(rows, differences, rcond=None)[0]
    return solution - solution.mean(0)
