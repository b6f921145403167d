"""Captures of any known format: `open_capture` finds out which one it is; `write_cameras` writes bare cameras."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..errors import DataError
from .capture import Capture
from .transforms_json import is_nerf_synthetic, is_transforms, read_nerf_synthetic, read_transforms, write_cameras

__all__ = ["open_capture", "write_cameras"]


@dataclass(frozen=True)
class Format:
    """A capture format: what it looks like, the test for it, and its reader (path, photos)."""

    name: str
    mark: str
    recognizes: Callable[[Path], bool]
    read: Callable[[Path, bool], Capture]


def open_capture(path: Path | str, photos: bool = True) -> Capture:
    """Read the capture at a file or folder, whatever its format. Raises DataError naming the file and the remedy.

    photos=False reads bare cameras: no photo is looked for, and picture sizes must be in the file.
    """
    path = Path(path)
    if not path.exists():
        raise DataError(f"{path} does not exist.", "Give the capture's folder or its camera file.")
    for known in FORMATS:
        if known.recognizes(path):
            return known.read(path, photos)
    marks = ", ".join(known.mark for known in FORMATS)
    raise DataError(f"{path} is no capture of a known format.", f"A capture has one of these: {marks}.")


def _is_llff(path: Path) -> bool:
    return (path / "poses_bounds.npy").is_file() or (path.is_file() and path.name == "poses_bounds.npy")


def _is_colmap(path: Path) -> bool:
    return (path / "sparse").is_dir() or any((path / f"images.{ending}").is_file() for ending in ("bin", "txt"))


def _not_read_yet(name: str) -> Callable[[Path, bool], Capture]:
    def refuse(path: Path, photos: bool) -> Capture:
        raise DataError(f"{path} is a {name} capture, which is not read yet.", "Convert it to a transforms.json.")

    return refuse


# the first that recognizes a path reads it
FORMATS = (
    Format("nerf-synthetic", "transforms_train.json", is_nerf_synthetic, read_nerf_synthetic),
    Format("transforms", "transforms.json", is_transforms, read_transforms),
    Format("llff", "poses_bounds.npy", _is_llff, _not_read_yet("LLFF (poses_bounds.npy)")),
    Format("colmap", "sparse/", _is_colmap, _not_read_yet("COLMAP (sparse/)")),
)
