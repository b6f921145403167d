"""Match mask files to photos by name: MASKS/<object>/<photo stem>.png, optionally in the photos' subfolders."""

from __future__ import annotations

import os
from pathlib import Path

from ..io.names import file_name
from .capture import View

SUFFIXES = (".png", ".jpg", ".jpeg", ".webp")


def mask_files(folder: Path) -> list[Path]:
    """Return the image files below an object's folder, sorted; hidden files and folders are skipped."""
    found = []
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        found += [Path(place, name) for name in names if not name.startswith(".")]
    return sorted(path for path in found if path.suffix.lower() in SUFFIXES)


def matches_view(below: Path, view: View) -> bool:
    """Test whether a mask, by its path below the object's folder, can belong to a view."""
    stem = file_name(below.stem)
    if len(below.parts) == 1:
        return stem in (view.name, view.stem)
    folders = below.parts[:-1]
    return view.image is not None and stem == view.stem and view.image.parts[:-1][-len(folders) :] == folders


def masks_of_view(folder: Path, view: View) -> list[Path]:
    """Return the masks of an object that can belong to a view; several if stems repeat, exact names first."""
    masks = [path for path in mask_files(folder) if matches_view(path.relative_to(folder), view)]
    return sorted(masks, key=lambda path: file_name(path.stem) != view.name)
