"""Frames of any camera as files, in the kinds of Blender's output panel: PNG of 8 or 16 bits, EXR of halves or floats."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import OpenEXR

from .color import srgb_to_linear, to_bytes
from .files import atomic_write

FORMATS = {"png8": ".png", "png16": ".png", "exr16": ".exr", "exr32": ".exr"}  # kind -> suffix
CLEAR = 1 / 512  # alpha below which a pixel has no color of its own


def write_frame(path: Path, color: np.ndarray, alpha: np.ndarray | None, kind: str) -> Path:
    """Write a picture, atomically: PNG as sRGB with straight alpha, EXR scene-linear with premultiplied alpha.

    Args:
        path: Without a suffix.
        color: sRGB [H, W, 3] in [0, 1], straight.
        alpha: [H, W] in [0, 1]; None for an opaque picture without an alpha channel.
        kind: One of `FORMATS`.

    Returns:
        The path with its suffix.
    """
    path = path.with_name(path.name + FORMATS[kind])
    write = _write_exr if FORMATS[kind] == ".exr" else _write_png
    atomic_write(path, lambda temporary: write(temporary, color, alpha, kind.endswith("16")))
    return path


def _write_png(path: Path, color: np.ndarray, alpha: np.ndarray | None, deep: bool) -> None:
    values = color[..., ::-1] if alpha is None else np.dstack([color[..., ::-1], alpha])  # OpenCV wants blue first
    pixels = np.rint(np.clip(values, 0, 1) * 65535).astype(np.uint16) if deep else to_bytes(values)
    done, encoded = cv2.imencode(".png", pixels)
    if not done:
        raise OSError(f"OpenCV cannot encode {pixels.dtype} {pixels.shape} as PNG.")
    path.write_bytes(encoded)


def _write_exr(path: Path, color: np.ndarray, alpha: np.ndarray | None, half: bool) -> None:
    light = srgb_to_linear(color)
    if alpha is not None:
        light = np.dstack([light * alpha[..., None], alpha])
    pixels = np.ascontiguousarray(light, np.float16 if half else np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB" if alpha is None else "RGBA": pixels}).write(str(path))


def cut_out(color: np.ndarray, alpha: np.ndarray, behind: np.ndarray) -> np.ndarray:
    """The color of what is solid, where a picture mixes it with what is behind: color = alpha own + (1 - alpha) behind.

    Args:
        color: [H, W, 3] in [0, 1].
        alpha: How much of each pixel is solid, [H, W] in [0, 1].
        behind: [H, W, 3] in [0, 1].

    Returns:
        [H, W, 3] in [0, 1], black where nothing is solid.
    """
    solid = alpha[..., None]
    own = np.divide(color - (1 - solid) * behind, solid, out=np.zeros_like(color), where=solid > CLEAR)
    return np.clip(own, 0, 1)
