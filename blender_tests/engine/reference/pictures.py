"""Random pictures, and views of them."""

from pathlib import Path

import numpy as np

from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.io.images import write_png

LENS = (-0.12, 0.05, 0.011, -0.0095, 0.01)  # k1, k2, p1, p2, k3: bends by several pixels


def random_bytes(*shape: int) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, size=shape, dtype=np.uint8)


def view_of(path: Path, pixels: np.ndarray, distortion=(), size=None) -> View:
    """Write a photo of these pixels and return its view; `size` is the camera's where it differs."""
    write_png(path, pixels)
    width, height = size or pixels.shape[1::-1]
    return View(path.stem, path.stem, Camera(width, height, 20.0, 22.0, 9.0, 6.0, np.eye(4), distortion), path, "train")
