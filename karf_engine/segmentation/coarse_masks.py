"""Read coarse masks from MASKS/<object>/<photo stem>.png and check them against the capture.

Where photos are in subfolders, masks may be in the same ones: MASKS/<object>/cam1/0001.png.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..capture.camera import Camera
from ..capture.capture import Capture, View, mask_files, mask_rank
from ..capture.training_images import TrainingImage, undistort
from ..errors import DataError, Message
from ..io.files import check_file, copy_file
from ..io.image_size import MOST_PHOTO_BYTES
from ..io.images import read_mask, resize
from ..io.names import file_name, first_case_collision, is_file_name, normalize_unicode

LAYOUT_HINT = "Lay masks out as MASKS/<object>/<photo stem>.png, as large as the photo."


@dataclass(frozen=True)
class CoarseMask:
    """The rough mask of one object in one view of any split, and its file."""

    object_name: str
    view: View
    path: Path


def find_masks(folder: Path, capture: Capture) -> list[CoarseMask]:
    """Return the masks in MASKS/<object>/<photo stem>.png (or .jpg, .jpeg, .webp), sorted by object and view.

    A mask is named after its photo's stem, or after its view where stems repeat, or is in the photo's subfolder. Raises
    DataError where nothing is marked, a name fits no photo or several, a mask is not a file, or an object's name is
    `background`, not a file name on every system, or equal to another's but for case.
    """
    if not folder.is_dir():
        raise DataError("{folder} is not a folder of masks.", LAYOUT_HINT, folder=folder)
    masks = []
    for path in object_folders(folder):
        own = masks_of_object(path, capture)
        if not own:
            raise DataError(f"{path} holds no mask of the object {path.name!r}.", LAYOUT_HINT)
        masks += own
    if not masks:
        raise DataError("{folder} holds no masks.", LAYOUT_HINT, folder=folder)
    return masks


def object_folders(folder: Path) -> list[Path]:
    """Return the objects' folders, sorted. Raises DataError where names differ only by case or Unicode form."""
    objects = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
    if same := first_case_collision(path.name for path in objects):
        raise DataError(
            f"{folder} names two objects {same[0]!r} and {same[1]!r}, one folder on Windows and macOS.",
            "Rename one of the folders; the same letters may be written in two Unicode forms.",
        )
    return objects


def marked_views(folder: Path, capture: Capture) -> set[str]:
    """Return the names of the views that files below MASKS/<object>/ are named after, without checking the files."""
    paths = [Path(*path.relative_to(folder).parts[1:]) for path in mask_files(folder)]
    matches = [_matching_views(path, capture) for path in paths if path.parts]
    return {views[0].name for views in matches if len(views) == 1}


def masks_of_object(folder: Path, capture: Capture) -> list[CoarseMask]:
    """Return the masks in one object's folder, sorted by file. Raises DataError as `find_masks` does."""
    if folder.name.lower() == "background":
        raise DataError(f"{folder} names an object 'background', which is what no mask covers.", "Rename the folder.")
    if not is_file_name(folder.name):
        raise DataError(f"{folder} names an object as no file can be called on every system.", "Rename the folder.")
    files = mask_files(folder)
    for path in files:
        check_file(path, MOST_PHOTO_BYTES)
    name = normalize_unicode(folder.name)
    masks = [CoarseMask(name, _view_of(path, folder, capture), path) for path in files]
    for first, second in itertools.pairwise(sorted(masks, key=lambda mask: mask.view.name)):
        if first.view.name == second.view.name:
            raise DataError(
                "{path} and {other} mark the same photo.", "Keep one of them.", path=first.path, other=second.path
            )
    return masks


def _view_of(path: Path, folder: Path, capture: Capture) -> View:
    views = _matching_views(path.relative_to(folder), capture)
    if len(views) == 1:
        return views[0]
    if views:
        raise DataError(
            f"{path} fits {len(views)} photos, the views {', '.join(view.name for view in views[:3])}.",
            "Name it after its view, or lay masks out in the photos' subfolders.",
        )
    first = next(iter(capture.views), None)
    hint = Message("The first one is {name!r}.", name=first.stem) if first else ""
    raise DataError("{path} is named after no photo.", hint, path=path)


def _matching_views(path: Path, capture: Capture) -> list[View]:
    """Return the views that a mask's path names most closely: the view of that name, else training views."""
    ranks = [mask_rank(path, view) for view in capture.views]
    best = min((rank for rank in ranks if rank is not None), default=None)
    matches = [view for view, rank in zip(capture.views, ranks, strict=True) if best is not None and rank == best]
    named = [view for view in matches if view.name == file_name(path.stem)]
    return named or [view for view in matches if view.split == "train"] or matches


def load_mask(mask: CoarseMask, training_image: TrainingImage) -> np.ndarray:
    """Return the mask at the training image's working size, bool [H, W].

    Raises DataError where the mask is damaged, empty, or as large as neither the photo nor the training image.
    """
    pixels = to_working_size(read_mask(mask.path), mask, training_image.camera) >= 0.5
    if not pixels.any():
        raise DataError(
            "{path} marks nothing of {name!r}.", "Paint the object white.", path=mask.path, name=mask.object_name
        )
    return pixels


def to_working_size(pixels: np.ndarray, mask: CoarseMask, working: Camera) -> np.ndarray:
    """Return the share of each pixel that a mask covers, [H, W] float32 in [0, 1], undistorted.

    pixels: bool, of the photo's size, distorted by its lens, or of the size of the pinhole `working`; else DataError.
    """
    height, width = pixels.shape
    stored, values = mask.view.camera, pixels.astype(np.float32)[..., None]
    if (width, height) == (stored.width, stored.height):
        values, _, _ = undistort(values, stored)
        return resize(values, working.width, working.height)[..., 0]
    if (width, height) != (working.width, working.height):
        raise DataError(
            "{path} is {width}x{height} pixels where its photo has {expected_width}x{expected_height}.",
            "Save the mask at the photo's size.",
            path=mask.path,
            width=width,
            height=height,
            expected_width=stored.width,
            expected_height=stored.height,
        )
    return values[..., 0]


def copy_masks(masks: list[CoarseMask], folder: Path) -> None:
    """Copy masks to <folder>/<object>/<view name>, keeping their formats."""
    for mask in masks:
        copy_file(mask.path, folder / mask.object_name / f"{mask.view.name}{mask.path.suffix}")
