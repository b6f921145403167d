"""Composite recolored pictures from edit planes: a few multiply-adds per pixel, fast enough to follow a dragged swatch.

Arguments shared by the functions of this module, for K objects and M palette entries of the largest palette (smaller
ones are zero padded):
    base: [H, W, 3] float32 sRGB in [0, 1], the picture without the edit.
    palette_weights: [K, M, H, W] >= 0, the weight of entry j of object k times the object's probability; the sum over
        j is the probability.
    probabilities: [K, H, W] in [0, 1] of the objects; the remainder to 1 is the background's.
    learned, edited: palettes [K, M, 3] before and after the edit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..capture.capture import UNIT_GAINS
from ..errors import DataError
from ..io.files import atomic_write
from ..io.names import check_names
from ..io.npz import has_arrays, read_arrays

BLOCK_PIXELS = 16384  # per block of rows, so that a block's working set stays in a core's cache
RENDER_AGAIN_HINT = "Run the render stage again, with planes."


@dataclass(frozen=True)
class Planes:
    """Edit planes of one picture, as stored."""

    objects: tuple[str, ...]  # names of the K objects
    palette_weights: np.ndarray  # [K, M, H, W] float16 in [0, 1], object probability included
    probabilities: np.ndarray  # [K, H, W] float16 in [0, 1]
    base: np.ndarray  # the picture without the edit, [H, W, 3] uint8 sRGB
    gains: tuple[float, float, float] = UNIT_GAINS  # exposure of the base; palettes have the mean exposure


def write_planes(path: Path, planes: Planes, made_from: str = "") -> None:
    """Write planes as a compressed npz, atomically; `planes_made_from` returns the fingerprint `made_from`."""
    arrays: dict[str, Any] = {
        "objects": np.array(planes.objects, dtype=np.str_),
        "palette_weights": planes.palette_weights.astype(np.float16),
        "probabilities": planes.probabilities.astype(np.float16),
        "base": planes.base,
    }
    if planes.gains != UNIT_GAINS:
        arrays["gains"] = np.array(planes.gains)
    if made_from:
        arrays["made_from"] = np.array(made_from)
    atomic_write(path, lambda temporary: np.savez_compressed(temporary, **arrays))


def read_planes(path: Path) -> Planes:
    """Read planes written by `write_planes`; raise DataError if they are missing, damaged or inconsistent."""
    parts = ("objects", "palette_weights", "probabilities", "base")
    objects, weights, probabilities, base = read_arrays(path, parts, "edit planes", RENDER_AGAIN_HINT)
    names = tuple(check_names(np.atleast_1d(objects).tolist(), path, "an object"))
    fits = weights.ndim == 4 and probabilities.shape == (len(names), *base.shape[:2])
    fits = fits and (weights.shape[0], *weights.shape[2:]) == probabilities.shape
    is_float = weights.dtype.kind == probabilities.dtype.kind == "f"
    if not (fits and is_float) or base.dtype != np.uint8 or base.shape[2:] != (3,):
        raise DataError(
            f"{path} (edit planes) has weights {weights.shape}, probabilities {probabilities.shape} "
            f"and base {base.shape}.",
            RENDER_AGAIN_HINT,
        )
    if not has_arrays(path, ("gains",)):
        return Planes(names, weights, probabilities, base)
    (gains,) = read_arrays(path, ("gains",), "edit planes", RENDER_AGAIN_HINT)
    if gains.shape != (3,) or gains.dtype.kind != "f" or not (np.isfinite(gains) & (gains > 0)).all():
        raise DataError(f"{path} (edit planes) has the gains {gains!r:.200}.", RENDER_AGAIN_HINT)
    return Planes(names, weights, probabilities, base, tuple(gains.tolist()))


def planes_made_from(path: Path) -> str:
    """Return the `made_from` passed to `write_planes`, or "" if it is missing or the file is unreadable."""
    try:
        (made_from,) = read_arrays(path, ("made_from",), "edit planes", RENDER_AGAIN_HINT)
    except DataError:
        return ""
    return str(made_from)


def stack_palettes(objects: Sequence[str], colors: Mapping[str, np.ndarray]) -> np.ndarray:
    """Stack the palettes [m, 3] of objects, given by name, zero padded to the largest: [K, M, 3] float32."""
    stacked = np.zeros((len(objects), max((len(colors[name]) for name in objects), default=0), 3), np.float32)
    for row, name in zip(stacked, objects, strict=True):
        row[: len(colors[name])] = colors[name]
    return stacked


def delta_composite(
    base: np.ndarray,
    palette_weights: np.ndarray,
    learned: np.ndarray,
    edited: np.ndarray,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """Add the palette change to the base: clip(base + sum_kj weights_kj (edited_kj - learned_kj)), [H, W, 3] float32.

    Pixels without weight in any changed swatch keep the base bit by bit. The result is linear in the edit: soft edges
    and highlights stay. Float16 weights give the same result as float32, but slowly. `out`, float32 [H, W, 3], may be a
    view such as rgba[..., :3]; not the base.
    """
    changes = np.asarray(edited, np.float32) - np.asarray(learned, np.float32)
    changed = np.argwhere(changes.any(axis=-1))
    result = np.empty(base.shape, np.float32) if out is None else out
    height, width = base.shape[:2]
    step = max(1, BLOCK_PIXELS // max(width, 1))
    planar = np.empty((3, step, width), np.float32)
    product = np.empty((step, width), np.float32)
    for top in range(0, height, step):
        rows = slice(top, min(top + step, height))
        weights = [(palette_weights[k, j, rows], changes[k, j]) for k, j in changed]
        weights = [(plane, change) for plane, change in weights if plane.max() > 0]
        if weights:
            _add_block(base[rows], weights, result[rows], planar[:, : rows.stop - top], product[: rows.stop - top])
        else:
            result[rows] = base[rows]
    return result


def _add_block(
    base: np.ndarray,
    weights: list[tuple[np.ndarray, np.ndarray]],
    block: np.ndarray,
    planar: np.ndarray,
    product: np.ndarray,
) -> None:
    """Write clip(base + sum of plane x change) to block [h, W, 3]; planar [3, h, W] and product [h, W] are scratch."""
    # contiguous planes: interleaved pixels are several times slower, and a product with 3 columns stalls in some BLAS
    for channel, total in enumerate(planar):
        summed = base[..., channel]
        for plane, change in weights:
            if change[channel]:
                np.multiply(plane, change[channel], out=product)
                summed = np.add(summed, product, out=total)
        block[..., channel] = np.clip(summed, 0, 1, out=total)


def hard_masks(probabilities: np.ndarray) -> np.ndarray:
    """Return the argmax class of each pixel (Eq. 8) as object masks, bool [K, H, W]; background is in no mask."""
    background = 1 - probabilities.sum(axis=0, dtype=np.float32)
    winner = np.concatenate([background[None], probabilities]).argmax(axis=0) - 1
    return winner == np.arange(len(probabilities))[:, None, None]


def paper_composite(
    base: np.ndarray, palette_weights: np.ndarray, probabilities: np.ndarray, edited: np.ndarray
) -> np.ndarray:
    """Replace the base inside each hard mask by the palette's mixture, sum_j weights_kj / prob_k edited_kj.

    Unlike `delta_composite`, this shows the palette's decomposition error even where nothing is edited. Returns float32
    [H, W, 3] in [0, 1].
    """
    result, palettes = np.array(base, np.float32), np.asarray(edited, np.float32)
    for k, mask in enumerate(hard_masks(probabilities)):
        share = palette_weights[k][:, mask].astype(np.float32)
        share /= probabilities[k][mask].astype(np.float32)
        for channel in range(3):
            color = sum(plane * palettes[k, j, channel] for j, plane in enumerate(share))
            result[mask, channel] = np.clip(color, 0, 1)
    return result
