"""Captures of any known format: `open_capture` finds out which one it is; `write_cameras` writes bare cameras.

A folder may hold several formats, some of them made from others. The first of `FORMATS` that recognizes it reads it;
`register_format` adds one, and so does an entry point `karf.formats` of an installed package that is a `Format`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import BadRequest, DataError
from ..io.arguments import checked
from ..io.plugins import load_plugin, plugin_names
from .camera import Camera
from .capture import Capture, CapturedSplats, SparsePoints, View, hold_out, in_space
from .colmap import is_colmap, read_colmap
from .llff import is_llff, read_llff
from .transforms_json import is_nerf_synthetic, is_transforms, read_nerf_synthetic, read_transforms, write_cameras

__all__ = [
    "FORMATS",
    "Camera",
    "Capture",
    "CapturedSplats",
    "Format",
    "SparsePoints",
    "View",
    "hold_out",
    "in_space",
    "open_capture",
    "register_format",
    "write_cameras",
]


@dataclass(frozen=True)
class Format:
    """A capture format.

    Attributes:
        name: The value of `Capture.format`, such as `colmap`.
        marker: The file or folder by which a person recognizes it, for messages.
        reason: Why it is read where later formats lie beside it; completes the sentence of a remark.
        recognizes: Whether a path, a file or folder that exists, is of this format; quick, by names alone.
        read: Reads such a path; the second argument is the `photos` of `open_capture`. Raises DataError.
    """

    name: str
    marker: str
    reason: str
    recognizes: Callable[[Path], bool]
    read: Callable[[Path, bool], Capture]


@checked
def open_capture(path: Path | str, photos: bool = True, holdout: int = 0) -> Capture:
    """Read a capture of any known format.

    Args:
        path: The capture's folder, or its camera file.
        photos: Whether to look for the photos; without them, picture sizes must be in the file.
        holdout: Hold out every Nth photo where the capture declares no test photos, see `hold_out`.

    Returns:
        The capture. A remark names the formats in the same folder that were not read.

    Raises:
        BadRequest: `holdout` is not a number of photos.
        DataError: The path does not exist, is of no known format, or is damaged.
        MissingDependency: An installed package brings a format, and cannot be loaded.

    Example:
        capture = open_capture("garden", holdout=8)
    """
    path = Path(path)
    if not path.exists():
        raise DataError("{path} does not exist.", "Give the capture's folder or its camera file.", path=path)
    for name in plugin_names("karf.formats"):
        register_format(load_plugin("karf.formats", name))
    found = [known for known in FORMATS if known.recognizes(path)]
    if not found:
        markers = ", ".join(known.marker for known in FORMATS)
        raise DataError(
            "{path} is not a capture of a known format.",
            "A capture has one of these: {markers}.",
            path=path,
            markers=markers,
        )
    best, *others = found
    capture = hold_out(best.read(path, photos), holdout)
    if path.is_file() or not others:
        return capture
    left = " or ".join(known.marker for known in others)
    return replace(capture, remarks=(*capture.remarks, f"{best.marker} was read, not {left}: {best.reason}."))


@checked
def register_format(added: Format) -> None:
    """Let `open_capture` read another format; it is asked before all that are known so far.

    Args:
        added: The format. Its `recognizes` must not be true of captures that it cannot read.

    Raises:
        TypeError: It is no format.
        BadRequest: Another format has this name.
    """
    known = {each.name: each for each in FORMATS}
    if known.get(added.name, added) != added:
        raise BadRequest(f"There is another capture format {added.name!r}.", "Choose another name.")
    if added.name not in known:
        FORMATS.insert(0, added)


# the first that recognizes a path reads it
FORMATS = [
    Format("nerf-synthetic", "transforms_train.json", "it declares the splits", is_nerf_synthetic, read_nerf_synthetic),
    Format("transforms", "transforms.json", "it is made from such files", is_transforms, read_transforms),
    Format("colmap", "sparse/", "it has the lenses and points that others leave out", is_colmap, read_colmap),
    Format("llff", "poses_bounds.npy", "", is_llff, read_llff),
]
