"""Which photo a file of a mask belongs to, by its name: MASKS/<object>/<photo stem>.png, or in the photos' subfolders."""

from __future__ import annotations

import os
from pathlib import Path

from ..io.names import file_name
from .capture import View

SUFFIXES = (".png", ".jpg", ".jpeg", ".webp")


def mask_files(folder: Path) -> list[Path]:
    """All that is named like a picture below an object's folder, in order; hidden files are not looked at."""
    found = []
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        found += [Path(place, name) for name in names if not name.startswith(".")]
    return sorted(path for path in found if path.suffix.lower() in SUFFIXES)


def fits_view(below: Path, view: View) -> bool:
    """Whether a mask can mean this view: by the photo's subfolders, else by name; below: its path in its object's folder."""
    stem = file_name(below.stem)
    if len(below.parts) == 1:
        return stem in (view.name, view.stem)
    folders = below.parts[:-1]
    return view.image is not None and stem == view.stem and view.image.parts[:-1][-len(folders) :] == folders


def masks_of_view(folder: Path, view: View) -> list[Path]:
    """An object's masks that can mean this view, the likeliest first: there is one, or stems repeat."""
    found = [path for path in mask_files(folder) if fits_view(path.relative_to(folder), view)]
    return sorted(found, key=lambda path: file_name(path.stem) != view.name)
