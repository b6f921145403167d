"""Photos from a video: the sharpest frame of each of some equal stretches."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np

from ...errors import Cancelled, DataError
from ...io.images import write_png
from ...io.inputs import check_file
from ...io.library_paths import library_path

MOST_FRAMES = 100
SHARPNESS_WIDTH = 480  # pixels of the width at which sharpness is measured; at full size grain counts as sharpness


def write_sharpest_frames(video: Path, folder: Path, should_stop: Callable[[], bool]) -> list[str]:
    """Write at most about 100 frames as `frame_0001.png` .. into `folder`, evenly spaced, and return their names.

    Frames are upright, as the video declares. Raises DataError where the file is not a readable video, and Cancelled.
    """
    names: list[str] = []
    stretch = max(1, round(_count(video, should_stop) / MOST_FRAMES))
    best, best_sharpness, seen = None, -1.0, 0
    for frame in _frames(video, should_stop):
        sharpness = _sharpness(frame)
        if sharpness > best_sharpness:
            best, best_sharpness = frame, sharpness
        seen += 1
        if seen % stretch == 0:
            names.append(f"frame_{len(names) + 1:04d}.png")
            write_png(folder / names[-1], cv2.cvtColor(best, cv2.COLOR_BGR2RGB))
            best, best_sharpness = None, -1.0
    return names


def _count(video: Path, should_stop: Callable[[], bool]) -> int:
    """Number of frames; headers often lie about it, so they are counted."""
    check_file(video, sys.maxsize)
    count = sum(1 for _ in _frames(video, should_stop, decode=False))
    if count == 0:
        raise DataError(
            "{path} is not a video that can be read.", "Give a folder of photos, or an MP4 video.", path=video
        )
    return count


def _frames(video: Path, should_stop: Callable[[], bool], decode: bool = True) -> Iterator[np.ndarray | None]:
    """Frames as uint8 [H, W, 3] in OpenCV's order (blue first); without `decode`, one None a frame."""
    with library_path(video) as readable:
        reader = cv2.VideoCapture(readable)
    try:
        while reader.grab():
            if should_stop():
                raise Cancelled(f"Reading {video} was cancelled.", "Start it again when you like.")
            yield reader.retrieve()[1] if decode else None
    finally:
        reader.release()


def _sharpness(frame: np.ndarray) -> float:
    """Variance of the Laplacian: motion blur and missed focus lower it."""
    gray = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
    scale = min(1.0, SHARPNESS_WIDTH / gray.shape[1])
    small = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return float(cv2.Laplacian(small, cv2.CV_32F).var())
