"""Frames of any camera as files: PNG of 8 or 16 bits, EXR of halves or floats, as in Blender's output panel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR

from ..io.color import srgb_to_linear, to_bytes
from ..io.files import atomic_write
from ..io.images import encode_image
from ..io.library_paths import save_exr


def write_frame(path: Path, color: np.ndarray, kind: str) -> None:
    """Write a picture, atomically: PNG as sRGB with straight alpha, EXR scene-linear with premultiplied alpha.

    Args:
        path: With the kind's suffix.
        color: sRGB [H, W, 3], or with straight alpha [H, W, 4], in [0, 1].
        kind: One of `frame_options.FORMATS`.
    """
    atomic_write(path, lambda temporary: _write(temporary, color, kind))


def _write(path: Path, color: np.ndarray, kind: str) -> None:
    if kind == "png8":
        path.write_bytes(encode_image(".png", to_bytes(color)))
    elif kind == "png16":
        path.write_bytes(encode_image(".png", np.rint(np.clip(color, 0, 1) * 65535).astype(np.uint16)))
    else:
        pixels = _scene_linear(color).astype({"exr16": np.float16, "exr32": np.float32}[kind])
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        save_exr(OpenEXR.File(header, {"RGBA" if pixels.shape[-1] == 4 else "RGB": pixels}), path)


def _scene_linear(color: np.ndarray) -> np.ndarray:
    """Linearize sRGB and premultiply alpha."""
    light = srgb_to_linear(color[..., :3])
    return light if color.shape[-1] == 3 else np.concatenate([light * color[..., 3:], color[..., 3:]], -1)
