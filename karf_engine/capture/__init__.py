"""Captures of any known format: `open_capture` finds out which one it is; `write_cameras` writes bare cameras.

A folder may hold several, made from one another. The one that says most wins, in the order of `FORMATS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import DataError
from .capture import Capture
from .colmap import is_colmap, read_colmap
from .llff import is_llff, read_llff
from .transforms_json import is_nerf_synthetic, is_transforms, read_nerf_synthetic, read_transforms, write_cameras

__all__ = ["open_capture", "write_cameras"]


@dataclass(frozen=True)
class Format:
    """A capture format: what it looks like, the test for it, its reader (path, photos), and why it comes before those
    after it."""

    name: str
    mark: str
    reason: str
    recognizes: Callable[[Path], bool]
    read: Callable[[Path, bool], Capture]


def open_capture(path: Path | str, photos: bool = True) -> Capture:
    """Read the capture at a file or folder, whatever its format. Raises DataError naming the file and the remedy.

    photos=False reads bare cameras: no photo is looked for, and picture sizes must be in the file.
    """
    path = Path(path)
    if not path.exists():
        raise DataError(f"{path} does not exist.", "Give the capture's folder or its camera file.")
    found = [known for known in FORMATS if known.recognizes(path)]
    if not found:
        marks = ", ".join(known.mark for known in FORMATS)
        raise DataError(f"{path} is no capture of a known format.", f"A capture has one of these: {marks}.")
    best, *others = found
    capture = best.read(path, photos)
    if path.is_file() or not others:
        return capture
    left = " or ".join(known.mark for known in others)
    return replace(capture, remarks=(*capture.remarks, f"{best.mark} was read, not {left}: {best.reason}."))


# the first that recognizes a path reads it
FORMATS = (
    Format("nerf-synthetic", "transforms_train.json", "it declares the splits", is_nerf_synthetic, read_nerf_synthetic),
    Format("transforms", "transforms.json", "it is made from such files", is_transforms, read_transforms),
    Format("colmap", "sparse/", "it has the lenses and points that others leave out", is_colmap, read_colmap),
    Format("llff", "poses_bounds.npy", "", is_llff, read_llff),
)
