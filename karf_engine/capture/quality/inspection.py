"""Measure a capture before training: sharpness, exposure, camera placement and agreement of matches."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError
from ...io.color import to_bytes
from ...io.images import alpha_composite, read_mask, resize
from ..capture import Capture, View, masks_of_view
from ..poses.triangulation import neighbor_pairs
from ..sparse_points import reprojection_errors, summarize
from ..training_images import load_views
from . import matches, photos
from .placement import Placement, measure_placement, seen_by_few

SIDE = 400  # longer side of the inspected photos, pixels
MOST_PHOTOS = 150  # photos opened at most, evenly spaced; all cameras are used
NEIGHBORS = 4  # photos compared with each photo
FEWEST = 3  # photos


@dataclass(frozen=True)
class Inspection:
    """Figures of a capture's photos and cameras.

    Attributes:
        views: Names of the training photos.
        opened: Indices of the opened photos.
        placement: Placement of all cameras.
        sharpness: Sharpness of the opened photos relative to their neighbors, [o].
        exposures: Stops of red, green and blue of the opened photos relative to the mean, [o, 3].
        plainness: See `photos.plainness`, dB.
        is_matte: Whether all opened photos have an alpha matte.
        agreed: Share of the matches between neighboring photos that agree with the cameras, in [0, 1].
        poor_pairs: Share of the pairs with few agreeing matches, in [0, 1].
        reprojection: Median reprojection error in pixels: of the sparse points in the photo as stored, else of the
            matches in photos of `SIDE` pixels; nan if there are none.
        seen_by_few: Share of the visible scene in at most two photos, in [0, 1].
        thin: Share of each masked object that is thinner than `photos.THIN` pixels, in [0, 1].
    """

    views: tuple[str, ...]
    opened: tuple[int, ...]
    placement: Placement
    sharpness: np.ndarray
    exposures: np.ndarray
    plainness: float
    is_matte: bool
    agreed: float
    poor_pairs: float
    reprojection: float
    seen_by_few: float
    thin: Mapping[str, float]

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

    Raises:
        DataError: There are too few photos, or one is missing or damaged.
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
    found = matches.match_neighbors(pictures, cameras, pairs)
    placement = measure_placement([view.camera for view in views], found.points)
    return Inspection(
        views=tuple(view.name for view in views),
        opened=opened,
        placement=placement,
        sharpness=photos.against_neighbors(np.array([photos.sharpness(each) for each in pictures]), pairs),
        exposures=matches.exposures(len(images), pairs, found.stops),
        plainness=photos.plainness(pictures),
        is_matte=all(image.alpha is not None for image in images),
        agreed=float(found.agreed.sum() / max(1, found.tried.sum())),
        poor_pairs=float((found.agreed < matches.FEW).mean()),
        reprojection=_reprojection(capture, views, found),
        seen_by_few=seen_by_few(cameras, placement.center),
        thin=dict(_thin_objects(masks, views)) if masks is not None else {},
    )


def _reprojection(capture: Capture, views: Sequence[View], found: matches.Matches) -> float:
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
        shares = [photos.thin_share(_small_mask(path)) for view in views for path in masks_of_view(masks, view)[:1]]
        if shares:
            yield masks.name, float(np.mean(shares))


def _small_mask(path: Path) -> np.ndarray:
    """Read a mask scaled down to `SIDE` pixels, bool [H, W]."""
    mask = read_mask(path)
    height, width = mask.shape
    factor = min(1.0, SIDE / max(height, width))
    return resize(mask.astype(np.float32), max(1, round(width * factor)), max(1, round(height * factor))) >= 0.5
