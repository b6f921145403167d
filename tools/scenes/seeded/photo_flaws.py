"""Flaws of photos: drifting exposure, blur and noise."""

from __future__ import annotations

from pathlib import Path

import imageio.v3 as iio
import numpy as np
from PIL import Image, ImageFilter

from ..files import write_picture
from .scene import PhotoFlaws

GAMMA = 2.2  # close enough to sRGB for a change of a few percent


def spoil_photos(out: Path, flaws: PhotoFlaws, seed: int) -> None:
    """Give the training photos of a capture its flaws; a recolor of such a photo gets the same."""
    for path in sorted(out.glob("train/*.png")):
        for file in (path, *out.glob(f"recolor/*/train/{path.name}")):
            write_picture(file, spoiled(iio.imread(file), flaws, np.random.default_rng((seed, int(path.stem[2:])))))


def spoiled(photo: np.ndarray, flaws: PhotoFlaws, rng: np.random.Generator) -> np.ndarray:
    """Return a photo (H, W, 3 or 4) uint8 with its flaws; a matte stays as it is, and its photo sharp."""
    color, matte = photo[..., :3], photo[..., 3:]
    if not matte.size:
        color = np.asarray(Image.fromarray(color).filter(ImageFilter.GaussianBlur(flaws.blur)))
    exposure = 1 + flaws.drift * rng.uniform(-1, 1)
    values = color / 255 * exposure ** (1 / GAMMA) + rng.normal(0, flaws.noise, color.shape)
    color = np.rint(255 * np.clip(values, 0, 1)).astype(np.uint8)
    return np.concatenate([color, matte], -1)
