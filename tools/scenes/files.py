"""Files of a capture."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

MADE_BY = "made_by.json"
LABEL_COLORS = (0, 0, 0, 220, 50, 40, 40, 90, 220, 90, 190, 50)


def write_png(path: Path, pixels: np.ndarray) -> None:
    """Write (H, W) or (H, W, 3) unsigned integers as a small PNG."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path, optimize=True)


def write_mask(path: Path, mask: np.ndarray) -> None:
    """Write a mask (H, W) bool as a PNG of 0 and 255."""
    write_png(path, np.where(mask, 255, 0).astype(np.uint8))


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


def unless_there(folder: Path, arguments: dict, make: Callable[[Path], None]) -> None:
    """Make a capture, unless ``folder`` has one of the same arguments; it appears there when it is complete."""
    made_by = folder / MADE_BY
    if made_by.exists() and json.loads(made_by.read_text(encoding="utf-8")) == arguments:
        print(f"{folder}: there already")
        return
    checkpoint = folder.with_name(f"{folder.name}.unfinished")
    shutil.rmtree(checkpoint, ignore_errors=True)
    make(checkpoint)
    write_json(checkpoint / MADE_BY, arguments)
    shutil.rmtree(folder, ignore_errors=True)
    checkpoint.rename(folder)
