"""Scores of pictures, masks, palettes and edits in held-out views against a known truth.

All scores are means over views; colors are sRGB in [0, 1]; masks bool [H, W].
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from karf_engine.metrics.images import hue_shift, mean_ciede2000, mse_outside, psnr, ssim
from karf_engine.metrics.masks import accuracy, iou, iou_border_excluded

MIN_PIXELS = 60  # of an object in a view that tests its mask


@dataclass(frozen=True)
class MaskScore:
    """Means over the views that show the object, the worst view, and the IoU of all their pixels together."""

    iou: float
    iou_border_excluded: float
    worst: float
    accuracy: float
    pooled: float


def score_masks(predicted: list[np.ndarray], truth: list[np.ndarray]) -> MaskScore:
    """Score one object's masks over the views that show it. Raises ValueError where none does."""
    pairs = [(p, t) for p, t in zip(predicted, truth, strict=True) if t.sum() >= MIN_PIXELS]
    if not pairs:
        raise ValueError(f"no view shows {MIN_PIXELS} pixels of the object")
    values = [iou(p, t) for p, t in pairs]
    inner = [iou_border_excluded(p, t) for p, t in pairs]
    accuracies = [accuracy(p, t) for p, t in pairs]
    pooled = iou(*(np.concatenate([mask.ravel() for mask in side]) for side in zip(*pairs, strict=True)))
    return MaskScore(*map(float, (np.mean(values), np.mean(inner), np.min(values), np.mean(accuracies), pooled)))


def mean_mask_scores(predicted: dict[str, list[np.ndarray]], truth: dict[str, list[np.ndarray]]) -> MaskScore:
    """Return the means over objects of `score_masks`; both are masks by object, view by view."""
    scores = [astuple(score_masks(masks, truth[name])) for name, masks in predicted.items()]
    return MaskScore(*np.mean(scores, 0).tolist())


def palette_picture(palette_weights: np.ndarray, probabilities: np.ndarray, palettes: np.ndarray) -> np.ndarray:
    """Return each object's colors as its palette mixes them, W P / probability, [K, H, W, 3]; shapes: `score_palettes`."""
    mixed = np.einsum("kmhw,kmc->khwc", palette_weights.astype(np.float32), palettes)
    return np.clip(mixed / np.maximum(probabilities, 1e-4)[..., None], 0, 1)


@dataclass(frozen=True)
class PaletteScore:
    """Similarity of palette mixes with the photos: of the whole frame on black, and inside the objects."""

    psnr_frame: float
    ssim_frame: float
    psnr_object: float
    ssim_object: float


def score_palettes(
    palette_weights: list[np.ndarray],
    probabilities: list[np.ndarray],
    palettes: np.ndarray,
    photos: list[np.ndarray],
    object_masks: list[np.ndarray],
) -> PaletteScore:
    """Score the objects as their palettes mix them, W P, against the photos.

    In the frame all else is black, as in the paper's segmented scene. Inside the true masks each object is shown opaque.
    Shapes: palettes [K, M, 3]; for each view, palette_weights [K, M, H, W], probabilities [K, H, W], masks [K, H, W].
    """
    rows = []
    for weights, shares, photo, masks in zip(palette_weights, probabilities, photos, object_masks, strict=True):
        inside = np.logical_or.reduce(masks)
        truth = np.where(inside[..., None], photo, 0)
        frame = np.clip(np.einsum("kmhw,kmc->hwc", weights.astype(np.float32), palettes), 0, 1)
        shown = (palette_picture(weights, shares, palettes) * masks[..., None]).sum(0)
        rows.append([psnr(frame, truth), ssim(frame, truth), psnr(shown, truth, inside), ssim(shown, truth, inside)])
    return PaletteScore(*np.mean(rows, 0).tolist())


@dataclass(frozen=True)
class RecolorScore:
    """Mean CIEDE2000 inside the edited objects and PSNR against the true recolor, and MSE outside against the photo."""

    ciede2000: float
    psnr: float
    mse_outside: float


def score_recolor(
    recolored: list[np.ndarray], truths: list[np.ndarray], photos: list[np.ndarray], insides: list[np.ndarray]
) -> RecolorScore:
    """Score recolored views. insides: union of the edited objects' true masks; an empty one gives no CIEDE2000."""
    rows = [
        [mean_ciede2000(ours, truth, inside), psnr(ours, truth), mse_outside(ours, photo, inside)]
        for ours, truth, photo, inside in zip(recolored, truths, photos, insides, strict=True)
    ]
    distances, psnrs, errors = np.array(rows).T
    return RecolorScore(float(np.nanmean(distances)), float(np.mean(psnrs)), float(np.mean(errors)))


def hue_shifted(
    photo: np.ndarray, masks: dict[str, np.ndarray], pairs: dict[str, tuple[np.ndarray, np.ndarray]]
) -> np.ndarray:
    """Return the photo with each object's hue shift inside its mask; pairs: object -> (source, target)."""
    result = photo.copy()
    for name, mask in masks.items():
        result[mask] = hue_shift(photo, *pairs[name])[mask]
    return result


def score_pictures(rendered: list[np.ndarray], photos: list[np.ndarray]) -> tuple[float, float]:
    """Return the mean and the worst PSNR."""
    values = [psnr(a, b) for a, b in zip(rendered, photos, strict=True)]
    return float(np.mean(values)), float(np.min(values))
