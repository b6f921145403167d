"""Read captures of any known format with `open_capture`, and write cameras with `write_cameras`.

The first of `FORMATS` that recognizes a path reads it. `register_format`, or an entry point `karf.formats` of an installed
package, adds a format.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import BadRequest, DataError
from ..io.arguments import check_arguments
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
        marker: The characteristic file or folder, for messages.
        reason: Why it takes precedence over later formats in the same folder; completes the sentence of a remark.
        recognizes: Predicate of an existing path; quick, by file names only.
        read: Reader of such a path; the second argument is `photos` of `open_capture`. Raises DataError.
    """

    name: str
    marker: str
    reason: str
    recognizes: Callable[[Path], bool]
    read: Callable[[Path, bool], Capture]


@check_arguments
def open_capture(path: Path | str, photos: bool = True, holdout: int = 0) -> Capture:
    """Read a capture of any known format.

    Args:
        path: The capture's folder, or its camera file.
        photos: Whether to search for the photos; without them, the file must declare image sizes.
        holdout: Hold out every Nth photo if the capture has no test photos, see `hold_out`.

    Returns:
        The capture; a remark names other formats found in the folder.

    Raises:
        BadRequest: `holdout` is invalid.
        DataError: The path does not exist, is of no known format, or is damaged.
        MissingDependency: A plugin format cannot be loaded.

    Example:
        capture = open_capture("garden", holdout=8)
    """
    path = Path(path)
    if not path.exists():
        raise DataError("{path} does not exist.", "Give the capture's folder or its camera file.", path=path)
    for name in plugin_names("karf.formats"):
        register_format(load_plugin("karf.formats", name))
    matching = [known for known in FORMATS if known.recognizes(path)]
    if not matching:
        markers = ", ".join(known.marker for known in FORMATS)
        raise DataError(
            "{path} is not a capture of a known format.",
            "A capture has one of these: {markers}.",
            path=path,
            markers=markers,
        )
    best, *others = matching
    capture = hold_out(best.read(path, photos), holdout)
    if path.is_file() or not others:
        return capture
    ignored = " or ".join(known.marker for known in others)
    return replace(capture, warnings=(*capture.warnings, f"{best.marker} was read, not {ignored}: {best.reason}."))


@check_arguments
def register_format(added: Format) -> None:
    """Add a capture format, with precedence over all known ones. Raises BadRequest if another format has its name."""
    known = {each.name: each for each in FORMATS}
    if known.get(added.name, added) != added:
        raise BadRequest(f"There is another capture format {added.name!r}.", "Choose another name.")
    if added.name not in known:
        FORMATS.insert(0, added)


FORMATS = [
    Format("nerf-synthetic", "transforms_train.json", "it declares the splits", is_nerf_synthetic, read_nerf_synthetic),
    Format("transforms", "transforms.json", "it is made from such files", is_transforms, read_transforms),
    Format("colmap", "sparse/", "it has the lenses and points that others leave out", is_colmap, read_colmap),
    Format("llff", "poses_bounds.npy", "", is_llff, read_llff),
]
