"""A capture looked at before it is learned: figures, what they mean, and where more photos would help."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError
from ...io.color import to_bytes
from ...io.images import over, read_mask, resize
from ..capture import Capture, View
from ..mask_names import masks_of_view
from ..poses.triangulation import neighbor_pairs
from ..reprojection import reprojection_errors, summarize
from ..training_images import TrainingImage, load_views
from . import matches, photos
from .placement import Placement, place, seen_by_few

SIDE = 400  # pixels: photos are looked at so small
MOST_PHOTOS = 150  # of more, this many in even steps are opened; cameras are all looked at
NEIGHBORS = 4  # photos that each photo is compared with
FEWEST = 3  # photos


@dataclass(frozen=True)
class Inspection:
    """What photos and cameras of a capture say.

    Attributes:
        views: Names of the photos that are learned from.
        opened: Numbers of those that were opened.
        placement: Where the cameras stand.
        sharpness: Of each photo that was opened against those beside it, [o]; 1 is as sharp.
        exposures: Of each of these, [o, 3], stops of red, green and blue against the mean.
        plainness: See `photos.plainness`, dB.
        is_matte: Whether nothing is behind the objects.
        agreed: Share of what looks alike in neighboring photos that the cameras agree with, in [0, 1].
        poor_pairs: Share of the pairs that share next to nothing, in [0, 1].
        reprojection: Median distance in pixels between where photos show points and where cameras see them: of the sparse
            points, in the photo as stored, else of the matches, in a photo of `SIDE` pixels; nan where there are none.
        seen_by_few: Share of what photos show that at most two show, in [0, 1].
        thin: Share of each marked object that is thinner than `photos.THIN` pixels, in [0, 1].
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
        """The figures as JSON values; null stands for what is unknown."""
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
    """Look at the photos that a capture is learned from.

    Args:
        capture: With photos.
        masks: A folder of rough masks, MASKS/<object>/<photo stem>.png.

    Raises:
        DataError: It has too few photos, or one is missing or damaged.
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
    cameras, pictures = [image.camera for image in images], [_picture(image) for image in images]
    pairs = neighbor_pairs(cameras, NEIGHBORS)
    found = matches.match_neighbors(pictures, cameras, pairs)
    placement = place([view.camera for view in views], found.points)
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


def _picture(image: TrainingImage) -> np.ndarray:
    """The photo on white, uint8 [H, W, 3]."""
    return to_bytes(over(image.color, image.alpha))


def _reprojection(capture: Capture, views: Sequence[View], found: matches.Matches) -> float:
    if capture.points is None:
        return float(np.median(found.errors)) if len(found.errors) else float("nan")
    wanted = {view.name for view in views}
    numbers = [n for n, view in enumerate(capture.views) if view.name in wanted]
    each = [summarize(*reprojection_errors(capture, n)) for n in numbers]
    medians = [summary.median for summary in each if summary.count]
    return float(np.median(medians)) if medians else float("nan")


def _thin_objects(folder: Path, views: Sequence[View]) -> Iterator[tuple[str, float]]:
    """Each marked object's name, and how much of its masks is thin in a photo of `SIDE` pixels."""
    for place_of in sorted(each for each in folder.iterdir() if each.is_dir()):
        shares = [photos.thin_share(_small_mask(path)) for view in views for path in masks_of_view(place_of, view)[:1]]
        if shares:
            yield place_of.name, float(np.mean(shares))


def _small_mask(path: Path) -> np.ndarray:
    """A mask in a picture of at most `SIDE` pixels, bool [H, W]; what is thinner than half a pixel is lost."""
    mask = read_mask(path)
    height, width = mask.shape
    factor = min(1.0, SIDE / max(height, width))
    return resize(mask.astype(np.float32), max(1, round(width * factor)), max(1, round(height * factor))) >= 0.5
