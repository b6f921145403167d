"""Held-out figures of a project against known truth: pictures, masks, palettes and edits.

All figures are means over views; colors are sRGB in [0, 1]; masks bool [H, W].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .edit.color import hue_shift
from .edit.metrics import iou, iou_border_excluded, mean_ciede2000, mse_outside, psnr, ssim

MIN_PIXELS = 60  # views that show less of an object say nothing about its mask


@dataclass(frozen=True)
class MaskScore:
    """Means over views that show the object, and the worst view."""

    iou: float
    iou_border_excluded: float
    worst: float


def score_masks(predicted: list[np.ndarray], truth: list[np.ndarray]) -> MaskScore:
    """IoU of one object's masks, view by view; the second figure leaves the truth's +-1 px border out.

    Raises ValueError where no view shows the object.
    """
    pairs = [(p, t) for p, t in zip(predicted, truth, strict=True) if t.sum() >= MIN_PIXELS]
    if not pairs:
        raise ValueError(f"no view shows {MIN_PIXELS} pixels of the object")
    values = [iou(p, t) for p, t in pairs]
    inner = [iou_border_excluded(p, t) for p, t in pairs]
    return MaskScore(float(np.mean(values)), float(np.mean(inner)), float(np.min(values)))


def palette_picture(palette_weights: np.ndarray, probabilities: np.ndarray, palettes: np.ndarray) -> np.ndarray:
    """The objects as their palettes mix them, W P / probability, for each object [K, H, W, 3].

    palette_weights: [K, M, H, W]; probabilities: [K, H, W]; palettes: [K, M, 3].
    """
    mixed = np.einsum("kmhw,kmc->khwc", palette_weights.astype(np.float32), palettes)
    return np.clip(mixed / np.maximum(probabilities, 1e-4)[..., None], 0, 1)


@dataclass(frozen=True)
class EditScore:
    """Mean CIEDE2000 inside the edited objects against the true recolor, and of what one would do without us.

    hue_shift: of the whole picture; hue_shift_in_true_mask has the same color inside, and nothing outside.
    """

    ours: float
    no_edit: float
    hue_shift: float
    hue_shift_in_true_mask: float
    mse_outside: float
    psnr: float


def score_edit(
    photos: list[np.ndarray],
    recolored: list[np.ndarray],
    truths: list[np.ndarray],
    object_masks: list[dict[str, np.ndarray]],
    pairs: dict[str, tuple[np.ndarray, np.ndarray]],
) -> EditScore:
    """Judge one edit. object_masks: per view the true masks of the edited objects; pairs: object -> (source, target).

    The global hue shift knows one color pair, the first object's; inside the true masks each object gets its own.
    """
    first_pair = next(iter(pairs.values()))
    rows = []
    for photo, ours, truth, masks in zip(photos, recolored, truths, object_masks, strict=True):
        inside = np.any(list(masks.values()), 0)
        shifted = hue_shift(photo, *first_pair)
        masked = photo.copy()
        for name, mask in masks.items():
            masked[mask] = hue_shift(photo, *pairs[name])[mask]
        differences = [mean_ciede2000(picture, truth, inside) for picture in (ours, photo, shifted, masked)]
        rows.append([*differences, mse_outside(ours, photo, inside), psnr(ours, truth)])
    return EditScore(*np.mean(rows, 0).tolist())


def score_pictures(rendered: list[np.ndarray], photos: list[np.ndarray]) -> dict[str, float]:
    """PSNR mean and worst, SSIM mean."""
    values = [psnr(a, b) for a, b in zip(rendered, photos, strict=True)]
    similarity = [ssim(a, b) for a, b in zip(rendered, photos, strict=True)]
    return {"psnr": float(np.mean(values)), "worst": float(np.min(values)), "ssim": float(np.mean(similarity))}
