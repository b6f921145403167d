"""Read captures of any known format with `open_capture`, and write cameras with `write_cameras`.

The first of `FORMATS` that recognizes a path reads it. `register_format`, or an entry point `karf.formats` of an installed
package, adds a format.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import BadRequest, DataError, Message
from ..io.arguments import check_arguments
from ..io.plugins import load_plugin, plugin_names
from .camera import Camera, Panorama
from .capture import SPLITS, Capture, View, hold_out, in_space, without_views
from .colmap import is_colmap, read_colmap
from .llff import is_llff, read_llff
from .metashape import is_metashape, read_metashape
from .opensfm import is_opensfm, read_opensfm
from .phone_scans import is_polycam, is_record3d, read_polycam, read_record3d
from .realityscan import is_realityscan, read_realityscan
from .transforms import is_nerf_synthetic, is_transforms, read_nerf_synthetic, read_transforms, write_cameras

__all__ = [
    "FORMATS",
    "Camera",
    "Capture",
    "Format",
    "View",
    "choose_views",
    "hold_out",
    "in_space",
    "open_capture",
    "read_capture",
    "register_format",
    "slice_of_views",
    "write_cameras",
]


@dataclass(frozen=True)
class Format:
    """A capture format."""

    name: str  # the value of `Capture.format`, such as `colmap`
    marker: str  # the characteristic file or folder, for messages
    reason: str  # why it takes precedence over later formats in a folder; completes the sentence of a remark
    recognizes: Callable[[Path], bool]  # quick, by file names only; the path exists
    read: Callable[[Path, bool], Capture]  # arguments: path and `photos` of `open_capture`; raises DataError


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
        DataError: The path does not exist, is of no known format, is damaged, or has 360-degree photos only.
        MissingDependency: A plugin format cannot be loaded.

    Example:
        capture = open_capture("garden", holdout=8)
    """
    path = Path(path)
    return hold_out(_without_panoramas(read_capture(path, photos), path), holdout)


def read_capture(path: Path, photos: bool = True) -> Capture:
    """Read a capture as `open_capture`, with 360-degree photos, whose cameras are `Panorama`s."""
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
    capture = best.read(path, photos)
    if path.is_file() or not others:
        return capture
    ignored = " or ".join(known.marker for known in others)
    return replace(capture, warnings=(*capture.warnings, f"{best.marker} was read, not {ignored}: {best.reason}."))


def _without_panoramas(capture: Capture, path: Path) -> Capture:
    names = [view.name for view in capture.views if isinstance(view.camera, Panorama)]
    if not names:
        return capture
    count, total = len(names), len(capture.views)
    hint = Message('Convert them in a terminal: karf pinhole "{path}" --out FOLDER. Then open that folder.', path=path)
    if count == total:
        raise DataError("The photos of {path} are 360-degree photos, not pinhole ones.", hint, path=path)
    remark = f"{count} of {total} photos were left out, because they are 360-degree photos. {hint}"
    return replace(without_views(capture, names), warnings=(*capture.warnings, remark))


@check_arguments
def register_format(added: Format) -> None:
    """Add a capture format, with precedence over all known ones. Raises BadRequest if another format has its name."""
    known = {each.name: each for each in FORMATS}
    if known.get(added.name, added) != added:
        raise BadRequest(f"There is another capture format {added.name!r}.", "Choose another name.")
    if added.name not in known:
        FORMATS.insert(0, added)


def choose_views(capture: Capture, wanted: str) -> tuple[list[View], bool]:
    """Return the views of a split, `all`, of names and ranges with commas, or of a CAMERAS.json; and False for the last.

    Raises DataError if a name is unknown or a split is empty.
    """
    if wanted in ("all", *SPLITS):
        views = list(capture.split(wanted))
        if not views:
            raise DataError(f"{capture.source} has no {wanted} views.", "Use another split, or all.")
        return views, True
    if wanted.endswith(".json"):
        return list(open_capture(Path(wanted), photos=False).views), False
    found = [view for part in wanted.split(",") for view in _range(capture, part.strip())]
    return list({view.name: view for view in found}.values()), True


def _range(capture: Capture, wanted: str) -> Sequence[View]:
    """Return the view of a name, or all from one name to another, as `0000-0007`; names may have a hyphen."""
    places = {view.name: place for place, view in enumerate(capture.views)}
    for hyphen in re.finditer("-", wanted if wanted not in places else ""):
        ends = wanted[: hyphen.start()].strip(), wanted[hyphen.end() :].strip()
        if all(name in places for name in ends):
            first, last = sorted(places[name] for name in ends)
            return capture.views[first : last + 1]
    return [capture.view(wanted)]


def slice_of_views(views: Sequence, first: int | None, last: int | None, count: int | None) -> slice:
    """Return the slice of views from number `first` to `last` (from 1, both included), at most `count` of them.

    Raises BadRequest if the slice is empty.
    """
    start = (1 if first is None else first) - 1
    ends = [len(views), *([last] if last is not None else []), *([start + count] if count is not None else [])]
    if not 0 <= start < min(ends):
        raise BadRequest(
            f"There are {len(views)} views; from number {start + 1} to {min(ends)} there are none.",
            "Views are counted from 1.",
        )
    return slice(start, min(ends))


FORMATS = [
    Format("opensfm", "reconstruction.json", "it has the lenses", is_opensfm, read_opensfm),
    Format("polycam", "keyframes/", "it has the app's own cameras", is_polycam, read_polycam),
    Format("record3d", "metadata and rgb/", "it has the app's own cameras", is_record3d, read_record3d),
    Format("nerf-synthetic", "transforms_train.json", "it declares the splits", is_nerf_synthetic, read_nerf_synthetic),
    Format("transforms", "transforms.json", "it is made from such files", is_transforms, read_transforms),
    Format("colmap", "sparse/", "it has the lenses and points that others leave out", is_colmap, read_colmap),
    Format("metashape", "cameras.xml", "it has all lenses", is_metashape, read_metashape),
    Format("realityscan", "cameras.csv or .xmp files", "it has all lenses", is_realityscan, read_realityscan),
    Format("llff", "poses_bounds.npy", "", is_llff, read_llff),
]
