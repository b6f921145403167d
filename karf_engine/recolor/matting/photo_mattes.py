"""Mattes of a photo at its own size: the field says roughly where the objects are, the photo exactly where.

First, at the field's picture size, each pixel near an object is asked twice: how probable the field finds each class
there, and how well the pixel's color fits the class about that place. Then the answer is carried up to the photo's size
in steps of two: labels far from any border are enlarged as they are, those near one are decided again at every step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...palettes.compositing import hard_masks
from ...segmentation.random_walk import links_of, random_walk
from .closed_form import closed_form_matting
from .color_models import ColorModels, fit_color_models, posterior
from .distances import distance_to
from .foreground import LINEAR, unmixed
from .lost_parts import difference_nearby, lost_parts
from .marks import Marks
from .matte import Matte
from .sharpness import sharp_size
from .strays import without_strays
from .tiles import enlarged, tiles

TILE, MARGIN = 512, 16  # pixels (not varied)


@dataclass(frozen=True)
class MatteParameters:
    """What decides a photo's mattes.

    They were set when mattes were first made in photos, together, and are measured together on the demo's photos, the
    drawn scenes and `single`, `hue`, `glossy`, `front` and `thin` (docs/benchmark.md, edges). No single one's influence
    is on record, unless it is said.

    Attributes:
        band: Pixels of the field's picture, by which an object's border in the photo may differ from the field's.
        ring: Pixels of the field's picture round objects in which their surroundings' colors are learned.
        core_depth: Pixels of the field's picture; deeper inside an object the field is right where it is `sure`.
        sure: Probability above which the field is sure of an object.
        none: Sum of the objects' probabilities below which the field is sure that there is none.
        least_probability: Of every class of the field, so that it never outvotes a color altogether.
        fewest_core_pixels: From which colors can be learned.
        prior_weight: Of a pixel's prior in the random walk.
        resolved_prior_weight: The same where the field is sure and shows the photo's color: between things of one color
            nothing else tells them apart.
        resolved_difference: Lab units, below which the field shows the photo's color.
        lost_parts_step: Number of enlargements after which parts that the field has lost are looked for: thin parts must
            be seen.
        step_band: Pixels about a border that are decided again after each enlargement.
        present: Pixels about one of a class in which others may be of that class too. Raised from 7, when an apple's
            stem was taken for a banana's elsewhere in the photo.
        decided: Probability above which a label is certain.
        least_carried: Prior of a class that is present near a border, when enlarged labels are decided again.
        border: Pixels to either side of a border whose coverage closed-form matting finds.
        certain: Labels above are not mixtures, however near the border: a stem is all border.
        unsure: Labels at least this far from 0 and 1 are mixtures, however far from the border; set for photos that are
            less sharp than their pixels.
        alone: Pixels from the object's certain pixels, beyond which a mixture's coverage is at least its label. Chosen
            on the cables and the wheel of thin scenes 0 and 1.
        least_agreement: IoU of photo and field, below which the field is right.
    """

    band: float = 6
    ring: float = 25
    core_depth: float = 1.0
    sure: float = 0.8
    none: float = 0.02
    least_probability: float = 0.005
    fewest_core_pixels: int = 20
    prior_weight: float = 0.05
    resolved_prior_weight: float = 1.0
    resolved_difference: float = 5.0
    lost_parts_step: int = 1
    step_band: int = 3
    present: int = 15
    decided: float = 0.98
    least_carried: float = 0.05
    border: float = 1.5
    certain: float = 0.99
    unsure: float = 0.3
    alone: float = 3.0
    least_agreement: float = 0.5


PARAMETERS = MatteParameters()


def refine_mattes(
    photo: np.ndarray, probabilities: np.ndarray, rendered: np.ndarray, marks: Marks | None = None, seed: int = 0
) -> list[Matte]:
    """Mattes of K objects from the field's soft answer and the photo.

    Args:
        photo: uint8 [H, W, 3] sRGB.
        probabilities: [K, h, w] float32 of the objects, of the field, on the photo's own grid, h <= H and w <= W.
        rendered: uint8 [h, w, 3] sRGB, the scene as the field shows it there.
        marks: What rough masks say to the photo, of thin parts alone; None: nothing.
        seed: Of the pixels that color models are fitted to.

    Returns:
        One matte for each object.
    """
    marks = marks or Marks(None, (False,) * len(probabilities))
    probabilities = without_strays(probabilities)
    if not hard_masks(probabilities).any():
        return unmixed(photo, np.zeros_like(probabilities))
    start = probabilities.shape[1:]
    field = lab_of(rendered)
    classes, models = decide(lab_of(_resized(photo, start)), probabilities, field, np.random.default_rng(seed))
    # what the photo's lens has blurred is a mixture over many of its pixels: it is decided where they are few
    end = np.maximum(sharp_size(photo, _near_border(classes)), start)
    sizes = steps(start, tuple(end.tolist()))[1:]
    for number, size in enumerate(sizes):
        reduced = _resized(photo, size)
        if number == min(PARAMETERS.lost_parts_step, len(sizes) - 1):
            classes = with_lost_parts(reduced, field, classes, models, marks)
        classes = sharpen(reduced, classes, models)
    coverage = cover(_resized(photo, classes.shape[1:]), classes)
    disputed = [_disagree(own, mask) for own, mask in zip(coverage, hard_masks(probabilities), strict=True)]
    for own, probability, is_disputed in zip(coverage, probabilities, disputed, strict=True):
        if is_disputed:
            own[:] = cv2.resize(probability, own.shape[::-1], interpolation=cv2.INTER_LINEAR)
    mattes = unmixed(photo, coverage)
    return [replace(matte, disputed=is_disputed) for matte, is_disputed in zip(mattes, disputed, strict=True)]


def _disagree(coverage: np.ndarray, mask: np.ndarray) -> bool:
    """Whether an object's coverage has little to do with the field's mask, bool [h, w]."""
    found = cv2.resize(coverage.astype(np.float32), mask.shape[::-1], interpolation=cv2.INTER_AREA) > 0.5
    return bool((found & mask).sum() < PARAMETERS.least_agreement * (found | mask).sum())


def with_lost_parts(
    photo: np.ndarray, rendered: np.ndarray, classes: np.ndarray, models: ColorModels, marks: Marks
) -> np.ndarray:
    """Classes [K+1, H, W] at the size of a photo, uint8 [H, W, 3], where parts that the field has lost are open.

    rendered: CIE Lab [h, w, 3], as the field shows the scene. marks: what rough masks say to the photo.
    """
    width, height = photo.shape[1::-1]
    classes = np.stack([cv2.resize(plane.astype(np.float32), (width, height)) for plane in classes])
    for k, found in enumerate(lost_parts(lab_of(photo), rendered, classes, models, marks), start=1):
        lost = found > 0
        classes[:, lost] = 0
        classes[0][lost], classes[k][lost] = 1 - found[lost], found[lost]
    return classes


def steps(start: tuple[int, int], end: tuple[int, int]) -> list[tuple[int, int]]:
    """Sizes (rows, columns) from one to the other, each at most twice the one before."""
    count = int(np.ceil(np.log2(max(end[0] / start[0], end[1] / start[1], 1)) - 1e-9))
    ratio = np.array(end) / start
    between = [tuple(np.rint(start * ratio ** (n / count)).astype(int).tolist()) for n in range(1, count)]
    return [tuple(start), *between, *([tuple(end)] if tuple(end) != tuple(start) else [])]


def decide(
    lab: np.ndarray, probabilities: np.ndarray, rendered: np.ndarray, random: np.random.Generator
) -> tuple[np.ndarray, ColorModels]:
    """Classes [K+1, h, w] at the field's picture size, class 0 being no object, and the colors that they have."""
    classes = np.concatenate([np.clip(1 - probabilities.sum(0), 0, 1)[None], probabilities])
    masks = hard_masks(probabilities)
    cores = [_core(mask, own) for mask, own in zip(masks, probabilities, strict=True)]
    away = np.stack([distance_to(mask) for mask in masks])
    nearest = away.min(0)
    surroundings = (probabilities.sum(0) < PARAMETERS.none) & (nearest < PARAMETERS.ring)
    models = fit_color_models(lab, np.stack([surroundings, *cores]), random)
    free = (nearest <= PARAMETERS.band) & ~np.any(cores, 0)
    of_field = np.maximum(classes, PARAMETERS.least_probability)
    of_field[1:][away > PARAMETERS.band] = 0
    labels = np.stack([~np.any(cores, 0), *cores]).astype(np.float32)
    labels[:, free] = posterior(models, lab[free], _places(free), of_field[:, free])
    resolved = (classes.max(0)[free] > PARAMETERS.decided) & (
        difference_nearby(lab, rendered, free, 1) < PARAMETERS.resolved_difference
    )
    weights = np.where(resolved, PARAMETERS.resolved_prior_weight, PARAMETERS.prior_weight)
    labels[:, free] = random_walk(links_of(lab), labels, free, weights)
    return labels, models


def sharpen(photo: np.ndarray, classes: np.ndarray, models: ColorModels) -> np.ndarray:
    """Classes [K+1, H, W] float16 at the size of a photo, uint8 [H, W, 3], from those [K+1, h, w] of a smaller size."""
    size = photo.shape[:2]
    result = np.empty((len(classes), *size), np.float16)
    for tile in tiles(size, TILE, MARGIN):
        labels = enlarged(classes, size, tile)
        free = _near_border(labels)
        if free.any():
            lab = lab_of(photo[tile.outer])
            places = (np.argwhere(free) + [tile.rows.start + 0.5, tile.columns.start + 0.5]) / size
            priors = np.maximum(labels, PARAMETERS.least_carried * _present(labels))[:, free]
            labels[:, free] = posterior(models, lab[free], places, priors)
            labels[:, free] = random_walk(links_of(lab), labels, free, PARAMETERS.prior_weight)
        result[(slice(None), *tile.place)] = labels[(slice(None), *tile.inner)]
    return result


def _present(labels: np.ndarray) -> np.ndarray:
    """Whether each class holds a pixel thereabouts: the far end of another object may have any color."""
    kernel = np.ones((2 * PARAMETERS.present + 1,) * 2, np.uint8)
    return np.stack([cv2.dilate((own > 0.5).astype(np.uint8), kernel) for own in labels])


def cover(photo: np.ndarray, classes: np.ndarray) -> np.ndarray:
    """Coverage [K, h, w] float16 of the objects from labels [K+1, h, w] of the size of the photo, uint8 [h, w, 3]."""
    result = np.zeros((len(classes) - 1, *photo.shape[:2]), np.float16)
    is_certain = classes[1:].max((1, 2)) >= PARAMETERS.certain
    for tile in tiles(photo.shape[:2], TILE, MARGIN):
        labels = classes[(slice(None), *tile.outer)].astype(np.float32)
        if labels[0].min() == 1:
            continue
        light = LINEAR[photo[tile.outer]]
        covered = np.stack([_border_matted(light, *each) for each in zip(labels[1:], is_certain, strict=True)])
        covered /= np.maximum(covered.sum(0), 1)
        result[(slice(None), *tile.place)] = covered[(slice(None), *tile.inner)]
    return result


def _border_matted(light: np.ndarray, label: np.ndarray, is_certain: bool) -> np.ndarray:
    """Coverage [h, w] of one object: 0 and 1 but along its border, where the colors [h, w, 3], linear, decide.

    is_certain: whether some pixel of the photo is certainly the object's, in this tile or another.
    """
    inside = label > 0.5
    if not inside.any() or inside.all():
        return inside.astype(np.float32)
    border = np.maximum(distance_to(inside), distance_to(~inside)) <= PARAMETERS.border
    unknown = (border & (label < PARAMETERS.certain)) | ((label > PARAMETERS.unsure) & (label < 1 - PARAMETERS.unsure))
    result = np.where(unknown, label, inside.astype(np.float32))
    result[unknown] = closed_form_matting(light, result, unknown)
    # a line that is all border has no certain pixel to be compared with: only its surroundings would speak;
    # an object without any certain pixel may be none at all, and is left to them
    away = distance_to(inside & ~unknown)
    thin = inside & unknown & (away > PARAMETERS.alone) & (is_certain | np.isfinite(away))
    result[thin] = np.maximum(result, label)[thin]
    return result


def _near_border(classes: np.ndarray) -> np.ndarray:
    top = classes.max(0)
    unsure = top < PARAMETERS.decided
    kernel = np.ones((2 * PARAMETERS.step_band + 1,) * 2, np.uint8)
    hard = classes.argmax(0).astype(np.uint8)
    border = cv2.dilate(hard, kernel) != cv2.erode(hard, kernel)
    return unsure | border


def _places(chosen: np.ndarray) -> np.ndarray:
    return (np.argwhere(chosen) + 0.5) / chosen.shape


def _core(mask: np.ndarray, probability: np.ndarray) -> np.ndarray:
    core = mask & (probability > PARAMETERS.sure) & (distance_to(~mask) > PARAMETERS.core_depth)
    if core.sum() >= PARAMETERS.fewest_core_pixels or not mask.any():
        return core
    return mask & (probability >= np.median(probability[mask]))  # a thin or small object has no deeper pixels


def lab_of(photo: np.ndarray) -> np.ndarray:
    """CIE Lab float32 [h, w, 3] of uint8 sRGB."""
    return cv2.cvtColor(photo.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)


def _resized(photo: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    if photo.shape[:2] == tuple(size):
        return photo
    return cv2.resize(photo, size[::-1], interpolation=cv2.INTER_AREA)
