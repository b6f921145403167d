"""Extract the sharpest frame of each segment of a video."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np

from ..errors import Cancelled, DataError
from ..io.images import write_png
from ..io.inputs import check_file
from ..io.library_paths import library_path

MOST_FRAMES = 100
SHARPNESS_WIDTH = 480  # width of the measured frame, pixels; at full size grain counts as sharpness


def write_sharpest_frames(video: Path, folder: Path, should_stop: Callable[[], bool]) -> list[str]:
    """Write about 100 frames at most, evenly spaced, as `frame_0001.png` ... into `folder`, and return their names.

    Frames are rotated as the video declares. Raises DataError if the file is not a readable video, or Cancelled.
    """
    names: list[str] = []
    segment = max(1, round(_count_frames(video, should_stop) / MOST_FRAMES))
    best, best_sharpness = np.empty(0), -1.0
    for number, reader in enumerate(_frames(video, should_stop), 1):
        frame = reader.retrieve()[1]
        sharpness = _sharpness(frame)
        if sharpness > best_sharpness:
            best, best_sharpness = frame, sharpness
        if number % segment == 0:
            names.append(f"frame_{len(names) + 1:04d}.png")
            write_png(folder / names[-1], cv2.cvtColor(best, cv2.COLOR_BGR2RGB))
            best_sharpness = -1.0
    return names


def _count_frames(video: Path, should_stop: Callable[[], bool]) -> int:
    """Count the frames, since headers are unreliable."""
    check_file(video, sys.maxsize)
    count = sum(1 for _ in _frames(video, should_stop))
    if count == 0:
        raise DataError(
            "{path} is not a video that can be read.", "Give a folder of photos, or an MP4 video.", path=video
        )
    return count


def _frames(video: Path, should_stop: Callable[[], bool]) -> Iterator[cv2.VideoCapture]:
    """Yield the reader at each frame; its `retrieve` decodes the frame as BGR."""
    with library_path(video) as readable:
        reader = cv2.VideoCapture(readable)
    try:
        while reader.grab():
            if should_stop():
                raise Cancelled(f"Reading {video} was cancelled.", "Start it again when you like.")
            yield reader
    finally:
        reader.release()


def _sharpness(frame: np.ndarray) -> float:
    """Return the variance of the Laplacian, which blur lowers."""
    gray = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
    scale = min(1.0, SHARPNESS_WIDTH / gray.shape[1])
    small = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return float(cv2.Laplacian(small, cv2.CV_32F).var())
