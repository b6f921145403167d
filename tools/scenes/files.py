"""Files of a capture."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image

JPEG = {"quality": 92, "subsampling": 0}  # colors at full size
LABEL_COLORS = (0, 0, 0, 220, 50, 40, 40, 90, 220, 90, 190, 50)


def write_picture(path: Path, pixels: np.ndarray) -> None:
    """Write (H, W) or (H, W, 3) unsigned integers as a small PNG or JPEG, by the suffix."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path, optimize=True, **(JPEG if path.suffix == ".jpg" else {}))


def write_mask(path: Path, mask: np.ndarray) -> None:
    """Write a mask (H, W) bool as a PNG of 0 and 255."""
    write_picture(path, np.where(mask, 255, 0).astype(np.uint8))


def write_labels(path: Path, ids: np.ndarray) -> None:
    """Write object ids (H, W) uint8 as a palette PNG whose pixel values are the ids."""
    path.parent.mkdir(parents=True, exist_ok=True)
    image = Image.fromarray(ids).convert("L")
    image.putpalette(LABEL_COLORS)
    image.save(path, optimize=True)


def write_json(path: Path, content) -> None:
    """Write ``content`` as indented JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
