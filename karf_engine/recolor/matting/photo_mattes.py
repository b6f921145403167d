"""Mattes of a photo's objects, by the field alone or refined: the field locates objects roughly, the photo exactly.

Refinement is coarse to fine. At the field's picture size, pixels near an object are labeled by the field's class
probabilities and by how well their colors fit each class there. The labels are then upsampled in factors of two, up to
the size that the photo is sharp at (many have more pixels than their lens resolves); those near a border are decided
again at every step.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ...io.images import resize
from ...palettes.compositing import hard_masks
from ...segmentation.random_walk import neighbor_links, random_walk
from .color_models import ColorModels, fit_color_models, posterior
from .matte import NEGLIGIBLE, Matte, cropped
from .mixed_pixels import LINEAR, closed_form_matting, unmix
from .thin_parts import Marks, difference_nearby, lost_parts
from .tiles import distance_to, tiles, upsample_tile

TILE, MARGIN = 512, 16  # pixels

# at the field's picture size, in its pixels
BAND = 6  # tolerance between an object's borders in photo and field
RING = 25  # around objects, where the colors of their surroundings are learned
CORE_DEPTH = 1.0  # deeper inside an object the field is right if it is sure
SURE = 0.8  # probability above which the field is sure of an object
BACKGROUND = 0.02  # sum of probabilities below which the field is sure of the background
MIN_PROBABILITY = 0.005  # of every class of the field, so that colors can outvote it
MIN_CORE_PIXELS = 20  # needed to learn its colors
PRIOR_WEIGHT = 0.05  # of a pixel's prior in the random walk
RESOLVED_PRIOR_WEIGHT = 1.0  # the same where the field is sure and renders the photo's color
RESOLVED_DIFFERENCE = 5.0  # Lab units: the field renders the photo's color

# after each upsampling, in pixels of that size
LOST_PARTS_STEP = 1  # step that searches lost parts: thin parts must be visible
STEP_BAND = 3  # around a border, decided again
PRESENT = 15  # up to this distance from a pixel of a class, others may be of it
DECIDED = 0.98  # probability above which a label is certain
MIN_CARRIED = 0.05  # prior of a class that is present near a border

# small components of the field's masks
SMALL = 0.02  # area, relative to the object's largest component
FAR = 0.25  # distance to the larger components, relative to the square root of that area

# blur, in pixels of the photo
BLUR_TILE, BLUR_MARGIN = 512, 8
SHARP = 0.9  # blur measured in renders and sharp photos
REBLUR = 1.0  # s0 of Zhuo and Sim
EDGE_QUANTILE = 0.8  # of a tile's gradients; steeper ones are edges
MAX_SHRINK = 0.9  # photos that would shrink less stay at their size
BLUR_QUANTILE = 0.25  # of the measured blurs: edges of light and shade are soft in sharp photos too
MIN_GRADIENT = 5.0  # of 255 per pixel; below is noise
MIN_EDGES = 50

# coverage, in pixels of the photo
BORDER = 1.5  # half width of the band along a border that closed-form matting solves for
CERTAIN = 0.99  # labels above are not mixtures, even near a border: a stem is all border
UNSURE = 0.3  # labels at least this far from 0 and 1 are mixtures anywhere, in unsharp photos
ALONE = 3.0  # beyond this distance to certain pixels, the coverage of a mixture is at least its label
MIN_AGREEMENT = 0.5  # IoU of photo and field, below which the field is right


def make_mattes(
    edges: str,  # `photo`: refined in the photo; `field`: the probabilities alone
    photo: np.ndarray,  # uint8 sRGB [H, W, 3]
    probabilities: np.ndarray,  # [K, h, w] float32 by the field, in the photo's grid, h <= H and w <= W
    rendered: np.ndarray,  # uint8 sRGB [h, w, 3], the field's rendering
    marks: Marks | None = None,  # of the photo, for thin parts alone
    seed: int = 0,  # for the pixels that color models are fitted to
) -> list[Matte]:
    """Make mattes of the K objects of a photo."""
    if edges == "field" or not len(probabilities):
        return field_mattes((photo.shape[1], photo.shape[0]), probabilities)
    marks = marks or Marks(None, (False,) * len(probabilities))
    # an occluded object may have several components: near ones stay
    probabilities = np.stack([own * ~_strays(own > 0.5) for own in probabilities])
    if not hard_masks(probabilities).any():
        return unmix(photo, np.zeros_like(probabilities))
    start = probabilities.shape[1], probabilities.shape[2]
    field = lab_of(rendered)
    classes, models = decide(lab_of(_resized(photo, start)), probabilities, field, np.random.default_rng(seed))
    # stop at the size where the photo is sharp: blurred edges are mixtures over many pixels
    end = np.maximum(sharp_size(photo, _near_border(classes)), start)
    sizes = steps(start, (int(end[0]), int(end[1])))[1:]
    for number, size in enumerate(sizes):
        reduced = _resized(photo, size)
        if number == min(LOST_PARTS_STEP, len(sizes) - 1):
            classes = with_lost_parts(reduced, field, classes, models, marks)
        classes = sharpen(reduced, classes, models)
    coverage = cover(_resized(photo, classes.shape[1:]), classes)
    disputed = [_disagree(own, mask) for own, mask in zip(coverage, hard_masks(probabilities), strict=True)]
    for own, probability, is_disputed in zip(coverage, probabilities, disputed, strict=True):
        if is_disputed:
            own[:] = cv2.resize(probability, own.shape[::-1], interpolation=cv2.INTER_LINEAR)
    mattes = unmix(photo, coverage)
    return [replace(matte, disputed=is_disputed) for matte, is_disputed in zip(mattes, disputed, strict=True)]


def field_mattes(size: tuple[int, int], probabilities: np.ndarray) -> list[Matte]:
    """Enlarge probabilities [K, h, w] to mattes of a photo of this width and height."""
    coverages = [resize(own, *size) for own in probabilities]
    # interpolated values need less precision
    dtype = np.float32 if probabilities.shape[1:] == (size[1], size[0]) else np.float16
    return [cropped(np.where(own > NEGLIGIBLE, own, 0), dtype) for own in coverages]


def _disagree(coverage: np.ndarray, mask: np.ndarray) -> bool:
    found = cv2.resize(coverage.astype(np.float32), mask.shape[::-1], interpolation=cv2.INTER_AREA) > 0.5
    return bool((found & mask).sum() < MIN_AGREEMENT * (found | mask).sum())


def with_lost_parts(
    photo: np.ndarray, rendered: np.ndarray, classes: np.ndarray, models: ColorModels, marks: Marks
) -> np.ndarray:
    """Upsample classes to the size of a photo, uint8 [H, W, 3], and add the parts that the field misses, [K+1, H, W]."""
    width, height = photo.shape[1::-1]
    classes = np.stack([cv2.resize(plane.astype(np.float32), (width, height)) for plane in classes])
    for k, found in enumerate(lost_parts(lab_of(photo), rendered, classes, models, marks), start=1):
        lost = found > 0
        classes[:, lost] = 0
        classes[0][lost], classes[k][lost] = 1 - found[lost], found[lost]
    return classes


def steps(start: tuple[int, int], end: tuple[int, int]) -> list[tuple[int, int]]:
    """Return sizes (rows, columns) from one to the other, each at most twice the one before."""
    count = int(np.ceil(np.log2(max(end[0] / start[0], end[1] / start[1], 1)) - 1e-9))
    ratio = np.array(end) / start
    between = [np.rint(start * ratio ** (n / count)).astype(int).tolist() for n in range(1, count)]
    return [start, *((rows, columns) for rows, columns in between), *([end] if end != start else [])]


def decide(
    lab: np.ndarray, probabilities: np.ndarray, rendered: np.ndarray, random: np.random.Generator
) -> tuple[np.ndarray, ColorModels]:
    """Label the photo at the field's picture size: classes [K+1, h, w], class 0 the background, and their colors."""
    classes = np.concatenate([np.clip(1 - probabilities.sum(0), 0, 1)[None], probabilities])
    masks = hard_masks(probabilities)
    cores = [_core(mask, own) for mask, own in zip(masks, probabilities, strict=True)]
    away = np.stack([distance_to(mask) for mask in masks])
    nearest = away.min(0)
    background = (probabilities.sum(0) < BACKGROUND) & (nearest < RING)
    models = fit_color_models(lab, np.stack([background, *cores]), random)
    free = (nearest <= BAND) & ~np.any(cores, 0)
    of_field = np.maximum(classes, MIN_PROBABILITY)
    of_field[1:][away > BAND] = 0
    labels = np.stack([~np.any(cores, 0), *cores]).astype(np.float32)
    places = (np.argwhere(free) + 0.5) / free.shape
    labels[:, free] = posterior(models, lab[free], places, of_field[:, free])
    resolved = (classes.max(0)[free] > DECIDED) & (difference_nearby(lab, rendered, free, 1) < RESOLVED_DIFFERENCE)
    weights = np.where(resolved, RESOLVED_PRIOR_WEIGHT, PRIOR_WEIGHT)
    labels[:, free] = random_walk(neighbor_links(lab), labels, free, weights)
    return labels, models


def sharpen(photo: np.ndarray, classes: np.ndarray, models: ColorModels) -> np.ndarray:
    """Upsample classes [K+1, h, w] to a photo, uint8 [H, W, 3], and decide those near borders again: float16."""
    size = photo.shape[:2]
    result = np.empty((len(classes), *size), np.float16)
    for tile in tiles(size, TILE, MARGIN):
        labels = upsample_tile(classes, size, tile)
        free = _near_border(labels)
        if free.any():
            lab = lab_of(photo[tile.outer])
            places = (np.argwhere(free) + [tile.rows.start + 0.5, tile.columns.start + 0.5]) / size
            priors = np.maximum(labels, MIN_CARRIED * _present(labels))[:, free]
            labels[:, free] = posterior(models, lab[free], places, priors)
            labels[:, free] = random_walk(neighbor_links(lab), labels, free, PRIOR_WEIGHT)
        result[(slice(None), *tile.place)] = labels[(slice(None), *tile.inner)]
    return result


def _present(labels: np.ndarray) -> np.ndarray:
    """Return where each class has a pixel nearby; elsewhere its colors do not count."""
    kernel = np.ones((2 * PRESENT + 1,) * 2, np.uint8)
    return np.stack([cv2.dilate((own > 0.5).astype(np.uint8), kernel) for own in labels])


def cover(photo: np.ndarray, classes: np.ndarray) -> np.ndarray:
    """Compute coverage [K, h, w] float16 from labels [K+1, h, w] of the photo, uint8 [h, w, 3]."""
    result = np.zeros((len(classes) - 1, *photo.shape[:2]), np.float16)
    is_certain = classes[1:].max((1, 2)) >= CERTAIN
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
    """Compute coverage [h, w] of one object by linear colors; is_certain: whether any tile has a certain pixel of it."""
    inside = label > 0.5
    if not inside.any() or inside.all():
        return inside.astype(np.float32)
    border = np.maximum(distance_to(inside), distance_to(~inside)) <= BORDER
    unknown = (border & (label < CERTAIN)) | ((label > UNSURE) & (label < 1 - UNSURE))
    result = np.where(unknown, label, inside.astype(np.float32))
    result[unknown] = closed_form_matting(light, result, unknown)
    # a line without certain pixels would take its coverage from the background alone, so its labels count;
    # not for an object without any certain pixel, which may be an error of the field
    away = distance_to(inside & ~unknown)
    thin = inside & unknown & (away > ALONE) & (is_certain | np.isfinite(away))
    result[thin] = np.maximum(result, label)[thin]
    return result


def _near_border(classes: np.ndarray) -> np.ndarray:
    kernel = np.ones((2 * STEP_BAND + 1,) * 2, np.uint8)
    hard = classes.argmax(0).astype(np.uint8)
    return (classes.max(0) < DECIDED) | (cv2.dilate(hard, kernel) != cv2.erode(hard, kernel))


def _core(mask: np.ndarray, probability: np.ndarray) -> np.ndarray:
    core = mask & (probability > SURE) & (distance_to(~mask) > CORE_DEPTH)
    if core.sum() >= MIN_CORE_PIXELS or not mask.any():
        return core
    return mask & (probability >= np.median(probability[mask]))  # thin and small objects have no deeper pixels


def lab_of(photo: np.ndarray) -> np.ndarray:
    """Convert uint8 sRGB to CIE Lab, float32 [h, w, 3]."""
    return cv2.cvtColor(photo.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)


def _resized(photo: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    if photo.shape[:2] == size:
        return photo
    return cv2.resize(photo, size[::-1], interpolation=cv2.INTER_AREA)


def _strays(mask: np.ndarray) -> np.ndarray:
    """Return components that are both small and far from the larger ones, and all pixels nearest to them."""
    count, parts, figures, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if count <= 2:
        return np.zeros_like(mask)
    areas = figures[1:, cv2.CC_STAT_AREA]
    large = np.isin(parts, 1 + np.flatnonzero(areas >= SMALL * areas.max()))
    away = distance_to(large)
    far = [n for n in range(1, count) if away[parts == n].min() > FAR * areas.max() ** 0.5]
    strays = np.isin(parts, far)
    return distance_to(strays) < away if far else strays


def sharp_size(photo: np.ndarray, border: np.ndarray) -> tuple[int, int]:
    """Return the largest size (rows, columns) that a photo, uint8 [H, W, 3], is sharp at, no larger than its own.

    Blurring an edge of blur s again by s0 divides its gradient by R = sqrt(s^2 + s0^2) / s: s = s0 / sqrt(R^2 - 1)
    (Zhuo and Sim, "Defocus map estimation from a single image", 2011). border: bool [h, w], where edges are measured,
    of any smaller size.
    """
    height, width = photo.shape[:2]
    blurs = []
    for tile in tiles((height, width), BLUR_TILE, BLUR_MARGIN):
        near = border[_scaled(tile.rows, border.shape[0] / height), _scaled(tile.columns, border.shape[1] / width)]
        if near.any():
            blurs.append(_edge_blurs(photo[tile.outer], near))
    found = np.concatenate(blurs) if blurs else np.zeros(0)
    if len(found) < MIN_EDGES:
        return height, width
    shrink = SHARP / float(np.quantile(found, BLUR_QUANTILE))
    if shrink > MAX_SHRINK:
        return height, width
    return max(1, round(height * shrink)), max(1, round(width * shrink))


def _scaled(part: slice, factor: float) -> slice:
    return slice(int(part.start * factor), int(np.ceil(part.stop * factor)))


def _edge_blurs(photo: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Return the blurs of the steep edges near a border, pixels."""
    gray = cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY).astype(np.float32)
    here = cv2.resize(near.astype(np.uint8), gray.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
    steep, soft = _gradients(gray)[here], _gradients(cv2.GaussianBlur(gray, (0, 0), REBLUR))[here]
    edges = (steep >= np.quantile(steep, EDGE_QUANTILE)) & (steep > MIN_GRADIENT)
    ratio = np.maximum(steep[edges] / np.maximum(soft[edges], 1e-3), 1.001)
    return REBLUR / np.sqrt(ratio**2 - 1)


def _gradients(gray: np.ndarray) -> np.ndarray:
    return np.hypot(cv2.Sobel(gray, cv2.CV_32F, 1, 0), cv2.Sobel(gray, cv2.CV_32F, 0, 1)) / 8
