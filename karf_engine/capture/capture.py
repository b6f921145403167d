"""A capture (cameras with photos, split into train and test), its canonical JSON, and the names of its mask files.

The canonical JSON (`capture.json`) has each path twice, absolute and relative to the JSON's folder, so that a project can
be moved together with its photos. Masks are MASKS/<object>/<photo stem>.png, optionally in the photos' subfolders.
"""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadRequest, DataError
from ..io.arguments import check_arguments, check_choice, check_fields
from ..io.color_spaces import ColorSpace
from ..io.matching import mask_stems
from ..io.names import case_folded, check_name, check_names, file_name
from .camera import LARGEST_POSITION, Camera, check_camera, read_camera
from .distortion import RAD_TAN_KEYS, THIN_PRISM_KEYS

SCHEMA = "karf-capture/1"
WITH_SPLATS = "karf-capture/2"  # adds `splats`, which older readers would ignore
WITH_SPACES = "karf-capture/3"  # adds `color_space`, which older readers would ignore
UNIT_GAINS = (1.0, 1.0, 1.0)  # gains of a photo with the mean exposure
SPLITS = ("train", "val", "test")
MASK_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp")


@dataclass(frozen=True)
class View:
    """A captured photo or a bare camera.

    Attributes:
        name: Name, unique in the capture and a valid file name.
        stem: Stem of the photo, a valid file name.
        camera: Camera of the photo as stored.
        image: Absolute path of the photo; None for a bare camera.
        split: `train`, `val` or `test`.
        depth_bounds: Nearest and farthest depth in world units; None if unknown.
        space: Color space of the photo's file; None: sRGB, for EXR linear light with its primaries.
        gains: Exposure relative to the mean of all photos: factors of red, green and blue in sRGB.
        mask: File name that the capture gives the photo's mask (nerfstudio's `mask_path`); empty: that of the photo.

    Example:
        height, width = capture.view("r_003").camera.height, capture.view("r_003").camera.width
    """

    name: str
    stem: str
    camera: Camera
    image: Path | None
    split: str
    depth_bounds: tuple[float, float] | None = None
    space: ColorSpace | None = field(default=None, kw_only=True)
    gains: tuple[float, float, float] = field(default=UNIT_GAINS, kw_only=True)
    mask: str = field(default="", kw_only=True)

    def __post_init__(self) -> None:
        check_fields(self)
        check_choice("split", self.split, SPLITS)
        check_camera(self.camera, f"The view {self.name:.200}", "Correct it.")
        if not (self.name and self.stem):
            raise BadRequest("A view's name or stem is empty.", "Name it.")
        if self.depth_bounds is not None and not 0 < self.depth_bounds[0] < self.depth_bounds[1] < math.inf:
            raise BadRequest(
                f"depth_bounds = {self.depth_bounds} is no range.", "Give the nearest and the farthest depth."
            )

    def __repr__(self) -> str:
        return f"View({self.name}, {self.camera.width}x{self.camera.height}, {self.split})"


@dataclass(frozen=True)
class SparsePoints:
    """n sparse points of structure from motion, and their m observations, in pixels of the photos as stored."""

    positions: np.ndarray  # [n, 3] float64, world
    colors: np.ndarray  # [n, 3] uint8 sRGB
    errors: np.ndarray  # [n] float32, mean reprojection error in pixels; nan if unknown
    view: np.ndarray  # [m] int32, view index
    point: np.ndarray  # [m] int32, point index
    pixels: np.ndarray  # [m, 2] float32

    def __len__(self) -> int:
        return len(self.positions)

    def seen_by(self, views: Sequence[int]) -> SparsePoints:
        """Return all points with the observations of some views, which are renumbered in the given order."""
        new_index = np.full(max([*views, *self.view, 0]) + 1, -1, np.int32)
        new_index[list(views)] = np.arange(len(views))
        kept = new_index[self.view] >= 0
        return replace(self, view=new_index[self.view[kept]], point=self.point[kept], pixels=self.pixels[kept])


@dataclass(frozen=True)
class CapturedSplats:
    """Gaussians of the scene trained by another program, in the capture's world."""

    path: Path  # absolute; see `karf_engine.splats.formats`
    is_antialiased: bool = False  # trained with the opacity-compensated screen filter


@dataclass(frozen=True)
class Capture:
    """Cameras with their photos.

    Attributes:
        source: Absolute path of the file or folder read.
        format: Name of its format (see `karf_engine.capture.Format`).
        views: Views in file order.
        warnings: Sentences for the user about skipped or guessed data.
        points: Sparse points if the format has them; not in the canonical JSON.
        holdout: N if every Nth photo was held out (see `hold_out`), else 0; not in the canonical JSON.
        splats: Splats of another program, which replace training them.

    Example:
        capture = open_capture("garden", holdout=8)
        [view.name for view in capture.split("test")]
    """

    source: Path
    format: str
    views: tuple[View, ...]
    warnings: tuple[str, ...] = ()
    points: SparsePoints | None = None
    holdout: int = 0
    splats: CapturedSplats | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        _check_holdout(self.holdout)

    def __repr__(self) -> str:
        counts = [f"{len(self.split(name))} {name}" for name in SPLITS if self.split(name)]
        return f"Capture({self.source}, {self.format}: {', '.join(counts) or 'no views'})"

    @check_arguments
    def split(self, name: str) -> tuple[View, ...]:
        """Return the views of a split (`train`, `val`, `test`) or of `all`. Raises BadRequest for other names."""
        check_choice("split", name, ("all", *SPLITS))
        return self.views if name == "all" else tuple(view for view in self.views if view.split == name)

    @check_arguments
    def view(self, name: str) -> View:
        """Return the view with this name. Raises DataError if there is none."""
        for view in self.views:
            if view.name == name:
                return view
        first = f"Its first view is {self.views[0].name!r}." if self.views else "It has none."
        raise DataError(f"{self.source} has no view {name!r:.200}.", first)


def hold_out(capture: Capture, every: int) -> Capture:
    """Move every Nth training photo, in the order of the names from the first on, to the test split.

    A capture with test photos, or with fewer than `every` training photos, is returned unchanged, as for 0. LLFF's
    convention is 8. Raises BadRequest if `every` is 1 or negative.
    """
    _check_holdout(every)
    names = sorted(view.name for view in capture.split("train"))
    if not every or capture.split("test") or len(names) < every:
        return capture
    return replace(with_split(capture, names[::every], "test"), holdout=every)


def _check_holdout(every: int) -> None:
    if every < 0 or every == 1:
        raise BadRequest(
            f"holdout = {every}: every {every}th photo cannot be held out.", "Give 0 for none, or a number from 2."
        )


def in_space(capture: Capture, space: ColorSpace | None) -> Capture:
    """Return the capture with photos in a color space; unchanged for None."""
    if space is None:
        return capture
    return replace(capture, views=tuple(replace(view, space=space) for view in capture.views))


def with_gains(capture: Capture, gains: Mapping[str, Sequence[float]]) -> Capture:
    """Return the capture with the `View.gains` of some views, by name."""

    def exposed(view: View) -> View:
        red, green, blue = gains.get(view.name, view.gains)
        return replace(view, gains=(float(red), float(green), float(blue)))

    return replace(capture, views=tuple(map(exposed, capture.views)))


def with_split(capture: Capture, names: Collection[str], split: str) -> Capture:
    """Return the capture with the views of these names moved to a split."""
    return replace(
        capture, views=tuple(replace(view, split=split) if view.name in names else view for view in capture.views)
    )


def leave_out(capture: Capture, names: Collection[str]) -> Capture:
    """Move photos to the split `val`: nothing is learned from them, they can still be recolored.

    Raises DataError for a name that no view has.
    """
    return with_split(capture, [capture.view(name).name for name in names], "val")


def without_views(capture: Capture, names: Collection[str]) -> Capture:
    """Remove the views of these names, and their observations of sparse points."""
    kept = [number for number, view in enumerate(capture.views) if view.name not in names]
    points = None if capture.points is None else capture.points.seen_by(kept)
    return replace(capture, views=tuple(capture.views[number] for number in kept), points=points)


def capture_to_json(capture: Capture, folder: Path | None = None) -> dict[str, Any]:
    """Convert a capture to its canonical JSON, with paths relative to `folder` besides the absolute ones."""
    splats, schema = None, SCHEMA  # the oldest that can represent the capture
    if capture.splats is not None:
        schema = WITH_SPLATS
        path, is_antialiased = capture.splats.path, capture.splats.is_antialiased
        splats = {"path": str(path), **_from_folder("path", path, folder), "is_antialiased": is_antialiased}
    if any(view.space is not None for view in capture.views):
        schema = WITH_SPACES
    return {
        "schema": schema,
        "source": str(capture.source),
        "format": capture.format,
        "remarks": list(capture.warnings),
        **({} if splats is None else {"splats": splats}),
        "views": [
            {
                "name": view.name,
                "stem": view.stem,
                "split": view.split,
                "image": str(view.image) if view.image else None,
                **_from_folder("image", view.image, folder),
                "size": [view.camera.width, view.camera.height],
                "intrinsics": [view.camera.fx, view.camera.fy, view.camera.cx, view.camera.cy],
                "distortion": list(view.camera.distortion),
                "fisheye": view.camera.fisheye,
                "camera_to_world": view.camera.camera_to_world.tolist(),
                "depth_bounds": view.depth_bounds,
                **({} if view.space is None else {"color_space": asdict(view.space)}),
                **({} if view.gains == UNIT_GAINS else {"gains": list(view.gains)}),
                **({"mask": view.mask} if view.mask else {}),
            }
            for view in capture.views
        ],
    }


def capture_from_json(content: Any, path: Path) -> Capture:
    """Read a capture from its canonical JSON in the file `path`.

    Raises DataError if the content is damaged or has an unknown schema, an invalid name or an impossible camera.
    """
    schema = content.get("schema") if isinstance(content, dict) else None
    if schema not in (SCHEMA, WITH_SPLATS, WITH_SPACES):
        raise DataError(f"{path} has schema {schema!r}, not {WITH_SPACES}.", "Import the capture again.")
    try:
        views = tuple(_view_from_json(entry, f"{path}, view {n}", path) for n, entry in enumerate(content["views"]))
        source, format_name = Path(content["source"]), str(content["format"])
        splats = _splats_from_json(content.get("splats"), path)
        capture = Capture(source, format_name, views, tuple(map(str, content["remarks"])), splats=splats)
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
        raise DataError(f"{path} is not a canonical capture ({error!r:.200}).", "Import the capture again.") from error
    check_names([view.name for view in views], path, "a view")
    return capture


def _view_from_json(entry: dict[str, Any], label: str, path: Path) -> View:
    width, height = map(int, entry["size"])
    fx, fy, cx, cy = map(float, entry["intrinsics"])
    pose = np.array(entry["camera_to_world"], np.float64).reshape(4, 4)
    lens = tuple(map(float, entry["distortion"])), bool(entry.get("fisheye", False))
    camera = read_camera(label, width, height, fx, fy, cx, cy, pose, *lens, hint="Import the capture again.")
    lengths = (*range(5), len(THIN_PRISM_KEYS), len(RAD_TAN_KEYS)) if camera.fisheye else range(9)
    if len(camera.distortion) not in lengths or entry["split"] not in SPLITS:
        raise ValueError(f"{label}: its pose, lens or split")
    space, bounds = entry.get("color_space"), entry.get("depth_bounds")
    if bounds is not None:
        near, far = map(float, bounds)
        if not 0 < near < far <= LARGEST_POSITION:
            raise ValueError(f"the depth bounds {near:g} and {far:g}")
        bounds = near, far
    red, green, blue = map(float, entry.get("gains", UNIT_GAINS))
    if not all(0 < gain < math.inf for gain in (red, green, blue)):
        raise ValueError(f"its gains are {(red, green, blue)}")
    return View(
        stem=check_name(entry["stem"], path, "a photo"),
        name=check_name(entry["name"], path, "a view"),
        camera=camera,
        image=_find_file(path.parent, entry["image"], entry.get("image_from_here")),
        split=entry["split"],
        depth_bounds=bounds,
        space=None if space is None else ColorSpace(str(space["name"]), str(space["config"])),
        gains=(red, green, blue),
        mask=str(entry.get("mask", "")),
    )


def _splats_from_json(entry: Any, path: Path) -> CapturedSplats | None:
    if entry is None:
        return None
    file = _find_file(path.parent, entry["path"], entry.get("path_from_here"))
    if file is None:
        raise ValueError("its splats have no path")
    return CapturedSplats(file, bool(entry["is_antialiased"]))


def _from_folder(name: str, file: Path | None, folder: Path | None) -> dict[str, str]:
    if file is None or folder is None:
        return {}
    try:
        return {f"{name}_from_here": Path(os.path.relpath(file, folder)).as_posix()}
    except ValueError:  # another drive
        return {}


def _find_file(folder: Path, *paths: str | None) -> Path | None:
    """Return the first path, relative to the folder, that is a file; else the first path."""
    candidates = [Path(os.path.normpath(folder / text)) for text in paths if text]
    for candidate in candidates:
        with suppress(OSError):  # invalid names
            if candidate.is_file():
                return candidate
    return candidates[0] if candidates else None


# ----------------------------------------------------------------------------------------------------------- mask files
def mask_files(folder: Path) -> list[Path]:
    """Return the masks below an object's folder, sorted; hidden files and folders are skipped."""
    found = []
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        found += [Path(place, name) for name in names if not name.startswith(".")]
    return sorted(path for path in found if path.suffix.lower() in MASK_SUFFIXES)


def mask_rank(below: Path, view: View) -> int | None:
    """Return how closely a mask's path below the object's folder names a view, 0 best; None if it names another photo.

    A mask is called as the view or its photo, see `mask_stems`, or as the capture calls it. Case and Unicode form do not
    count. In subfolders it is called as the photo in the same subfolders.
    """
    keys = [case_folded(file_name(stem)) for stem in mask_stems(below.name)]
    folders = [case_folded(part) for part in below.parts[:-1]]
    if folders:
        outer = () if view.image is None else view.image.parts[:-1][-len(folders) :]
        names = [view.stem] if folders == [case_folded(part) for part in outer] else []
    else:
        names = [view.name, view.stem]
    ranks = [keys.index(key) for key in map(case_folded, names) if key in keys]
    if not ranks and names and view.mask and case_folded(view.mask) == case_folded(below.name):
        return len(keys)
    return min(ranks, default=None)


def masks_of_view(folder: Path, view: View) -> list[Path]:
    """Return the masks of an object that can belong to a view; several if stems repeat, closest names first."""
    ranked = [(mask_rank(path.relative_to(folder), view), path) for path in mask_files(folder)]
    named = [(rank, file_name(path.stem) != view.name, path) for rank, path in ranked if rank is not None]
    return [path for *_, path in sorted(named)]
