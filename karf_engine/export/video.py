"""Rendered pictures as a video."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadRequest, missing_extra
from ..io.arguments import check_arguments, check_array, check_number
from ..io.color import to_bytes
from ..io.files import atomic_write

SUFFIXES = (".mp4", ".mov", ".mkv")


@check_arguments
def write_video(path: Path | str, frames: Iterable[np.ndarray], fps: float = 30.0) -> None:
    """Write pictures as a video, one at a time; needs the extra `video`.

    Args:
        path: .mp4, .mov or .mkv.
        frames: [H, W, 3] sRGB in [0, 1], all of one size. An odd width or height is enlarged by one pixel.
        fps: Frames per second.

    Raises:
        BadRequest: The suffix is another one, there are no frames, or their sizes differ.
        MissingDependency: The package imageio-ffmpeg is missing.

    Example:
        cameras = orbit([view.camera for view in model.capture.views], 120)
        write_video("turn.mp4", (model.render_recolored(camera, edit) for camera in cameras))
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise BadRequest(f"{path} is not the name of a video.", f"Name one that ends with {', '.join(SUFFIXES)}.")
    check_number("fps", fps, 1, 1000)
    try:
        import imageio_ffmpeg  # noqa: F401
    except ImportError:
        raise missing_extra("imageio_ffmpeg", "video") from None
    atomic_write(path, lambda temporary: _encode(temporary, frames, fps))


def _encode(path: Path, frames: Iterable[np.ndarray], fps: float) -> None:
    from imageio.v2 import get_writer

    shape = None
    writer: Any = get_writer(path, format="FFMPEG", mode="I", fps=fps, macro_block_size=2)  # pyright: ignore
    with writer:
        for frame in frames:
            shape = shape or np.shape(frame)
            check_array("frames", frame, (*shape[:2], 3))
            writer.append_data(to_bytes(frame))
    if shape is None:
        raise BadRequest("The video was given no frames.", "Give at least one.")
