"""Frames of any camera as files, as in Blender's output panel: PNG of 8 or 16 bits, EXR of halves or floats."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR

from ..io.color import srgb_to_linear, to_bytes
from ..io.files import atomic_write
from ..io.images import encoded
from ..io.library_paths import save_exr


def write_frame(path: Path, color: np.ndarray, kind: str) -> None:
    """Write a picture, atomically: PNG as sRGB with straight alpha, EXR scene-linear with premultiplied alpha.

    Args:
        path: With the kind's suffix.
        color: sRGB [H, W, 3], or with straight alpha [H, W, 4], in [0, 1].
        kind: One of `frame_options.FORMATS`.
    """
    write = {"png8": _write_png8, "png16": _write_png16, "exr16": _write_exr16, "exr32": _write_exr32}[kind]
    atomic_write(path, lambda temporary: write(temporary, color))


def _write_png8(path: Path, color: np.ndarray) -> None:
    _write_png(path, to_bytes(color))


def _write_png16(path: Path, color: np.ndarray) -> None:
    _write_png(path, np.rint(np.clip(color, 0, 1) * 65535).astype(np.uint16))


def _write_png(path: Path, pixels: np.ndarray) -> None:
    path.write_bytes(encoded(".png", pixels))


def _write_exr16(path: Path, color: np.ndarray) -> None:
    _write_exr(path, _light(color).astype(np.float16))


def _write_exr32(path: Path, color: np.ndarray) -> None:
    _write_exr(path, _light(color).astype(np.float32))


def _light(color: np.ndarray) -> np.ndarray:
    """Scene-linear values of sRGB; alpha is multiplied in."""
    light = srgb_to_linear(color[..., :3])
    return light if color.shape[-1] == 3 else np.concatenate([light * color[..., 3:], color[..., 3:]], -1)


def _write_exr(path: Path, pixels: np.ndarray) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    save_exr(OpenEXR.File(header, {"RGBA" if pixels.shape[-1] == 4 else "RGB": pixels}), path)
