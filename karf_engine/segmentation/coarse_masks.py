"""Coarse masks on disk: MASKS/<object>/<photo stem>.png, checked against the capture.

Photos of several cameras lie in subfolders, and masks may lie in the same: MASKS/<object>/cam1/0001.png.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..capture.camera import Camera
from ..capture.capture import Capture, View
from ..capture.mask_names import fits_view, mask_files
from ..capture.training_images import TrainingImage, undistort
from ..errors import DataError, Message
from ..io.files import copy_file
from ..io.image_size import MOST_PHOTO_BYTES
from ..io.images import read_mask, resize
from ..io.inputs import check_file
from ..io.names import file_name, is_file_name, one_form, same_but_for_case

LAYOUT_HINT = "Lay masks out as MASKS/<object>/<photo stem>.png, as large as the photo."


@dataclass(frozen=True)
class CoarseMask:
    """One object's rough mask in one view.

    Attributes:
        object_name: the object's.
        view: the view that it was drawn on, of any split: a marked photo is used in training.
        path: the file as the user gave it.
    """

    object_name: str
    view: View
    path: Path


def find_masks(folder: Path, capture: Capture) -> list[CoarseMask]:
    """The masks below a folder, sorted by object and view.

    A mask is named after its photo's stem, or the view's name where stems repeat, or lies in the photo's subfolder.

    Args:
        folder: MASKS/<object>/<photo stem>.png, also .jpg, .jpeg or .webp.
        capture: whose photos the masks were drawn on.

    Raises:
        DataError: there is no mask, a name fits no photo or several, one is not a file, or an object is called
            `background`, or what no file can be called, or as another but for upper and lower case.
    """
    if not folder.is_dir():
        raise DataError("{folder} is not a folder of masks.", LAYOUT_HINT, folder=folder)
    masks = []
    for path in object_folders(folder):
        own = marks_of(path, capture)
        if not own:
            raise DataError(f"{path} holds no mask of the object {path.name!r}.", LAYOUT_HINT)
        masks += own
    if not masks:
        raise DataError("{folder} holds no masks.", LAYOUT_HINT, folder=folder)
    return masks


def object_folders(folder: Path) -> list[Path]:
    """The folders of a folder's objects, in order.

    Raises:
        DataError: two are one but for upper and lower case, or for the Unicode form of their letters.
    """
    objects = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
    if same := same_but_for_case(path.name for path in objects):
        raise DataError(
            f"{folder} names two objects {same[0]!r} and {same[1]!r}, one folder on Windows and macOS.",
            "Rename one of the folders; the same letters may be written in two Unicode forms.",
        )
    return objects


def marked_views(folder: Path, capture: Capture) -> set[str]:
    """Names of the views that something below MASKS/<object>/ is named after; nothing is checked."""
    files = [path.relative_to(folder).parts[1:] for path in mask_files(folder)]
    found = [fitting_views(Path(*below), capture) for below in files if below]
    return {views[0].name for views in found if len(views) == 1}


def marks_of(folder: Path, capture: Capture) -> list[CoarseMask]:
    """What marks an object in single photos, all pictures below its folder; errors as for `find_masks`."""
    if folder.name.lower() == "background":
        raise DataError(f"{folder} names an object 'background', which is what no mask covers.", "Rename the folder.")
    if not is_file_name(folder.name):
        raise DataError(f"{folder} names an object as no file can be called on every system.", "Rename the folder.")
    files = mask_files(folder)
    for path in files:
        check_file(path, MOST_PHOTO_BYTES)
    name = one_form(folder.name)
    masks = [CoarseMask(name, _view_of(path, path.relative_to(folder), capture), path) for path in files]
    for first, second in itertools.pairwise(sorted(masks, key=lambda mask: mask.view.name)):
        if first.view.name == second.view.name:
            raise DataError(
                "{path} and {other} mark the same photo.", "Keep one of them.", path=first.path, other=second.path
            )
    return masks


def _view_of(path: Path, below: Path, capture: Capture) -> View:
    """The view that a mask was drawn on; below: its path in the object's folder."""
    fitting = fitting_views(below, capture)
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        raise DataError(
            f"{path} fits {len(fitting)} photos, the views {', '.join(view.name for view in fitting[:3])}.",
            "Name it after its view, or lay masks out in the photos' subfolders.",
        )
    first = next(iter(capture.views), None)
    hint = Message("The first one is {name!r}.", name=first.stem) if first else ""
    raise DataError("{path} is named after no photo.", hint, path=path)


def fitting_views(below: Path, capture: Capture) -> list[View]:
    """The views that a mask's path in its object's folder can mean: the one of its name, else training ones, else any."""
    fitting = [view for view in capture.views if fits_view(below, view)]
    named = [view for view in fitting if view.name == file_name(below.stem)]
    return named or [view for view in fitting if view.split == "train"] or fitting


def load_mask(mask: CoarseMask, training_image: TrainingImage) -> np.ndarray:
    """The mask at the training image's working size.

    Args:
        mask: as large as the photo, or of the working size.
        training_image: the photo of its view.

    Returns:
        [H, W] bool.

    Raises:
        DataError: the mask is of another size, damaged or empty.
    """
    found = at_working_size(read_mask(mask.path), mask, training_image.camera) >= 0.5
    if not found.any():
        raise DataError(
            "{path} marks nothing of {name!r}.",
            "Paint the object white.",
            path=mask.path,
            name=mask.object_name,
        )
    return found


def at_working_size(drawn: np.ndarray, mask: CoarseMask, working: Camera) -> np.ndarray:
    """How much of each pixel of a smaller pinhole is drawn over, [H, W] float32 in [0, 1].

    Args:
        drawn: bool, of the photo's size, with its lens, or of the pinhole's.
        mask: its file and view.
        working: the pinhole.

    Raises:
        DataError: it is of another size.
    """
    height, width = drawn.shape
    stored = mask.view.camera
    values = drawn.astype(np.float32)[..., None]
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
    """Copy the masks into a folder, laid out as <object>/<view's name>.png (or as the mask's own format)."""
    for mask in masks:
        target = folder / mask.object_name / f"{mask.view.name}{mask.path.suffix}"
        copy_file(mask.path, target)
