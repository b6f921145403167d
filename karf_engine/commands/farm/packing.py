"""Collect, check and copy the files of a bundle.

All files are checked before any is copied. Only files of the project's or capture's own folder, or of a folder that the
user named, are packed: an untrusted project or capture may name or link to any file.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

from ...capture import open_capture
from ...capture.capture import Capture, View, capture_to_json
from ...errors import BadRequest, DataError
from ...io.containment import check_tree, is_link, leads_out
from ...io.files import checksum, write_json
from ...io.image_size import image_header
from ...project import Project
from ...project.contents import read_capture
from ...project.state import write_state
from .template import CAPTURE, MASKS, PROJECT

PHOTOS = "photos"
CAMERA_SUFFIXES = (".json", ".bin", ".txt", ".npy", ".ply")  # files that readers of captures open besides photos


@dataclass(frozen=True)
class PackedFile:
    """A file to pack: its path now, and its path in the bundle."""

    source: Path
    target: Path


def summary_of(files: Iterable[PackedFile]) -> list[str]:
    """Return a line for each source folder: the files' number, total size, first and last name."""
    lines = []
    for folder, group in groupby(sorted(files, key=lambda file: file.source), lambda file: file.source.parent):
        sources = [file.source for file in group]
        size = sum(source.stat().st_size for source in sources)
        names = sources[0].name if len(sources) == 1 else f"{sources[0].name} .. {sources[-1].name}"
        lines.append(f"packing {len(sources)} files, {size / 1e6:.1f} MB, of {folder}: {names}")
    return lines


def project_files(project: Project, views: Sequence[View], photos: Path | None) -> list[PackedFile]:
    """Return the files that rendering needs of a project, with the photos of these views.

    photos: a folder that photos may come from, beside the capture's and the project's. Raises BadRequest for others.
    """
    learned = (
        project.geometry_file,
        project.segmentation_file,
        project.segmentation_report,
        project.uncertainty_file,
        project.palette_file,
        project.object_colors_file,
        project.recoloring_file,
        project.splats_file,
    )
    files = [
        PackedFile(project.verified(path), Path(PROJECT, path.relative_to(project.folder)))
        for path in learned
        if path.exists()
    ]
    source = read_capture(project).source
    places = [source if source.is_dir() else source.parent, project.folder, photos]
    for view in views:
        if view.image:
            files.append(PackedFile(_checked_picture(view.image, places), Path(PHOTOS, _photo_name(view))))
    return files


def write_project(project: Project, target: Path, views: Sequence[View]) -> None:
    """Write project.json and capture.json of a packed project that has only these views' photos."""
    capture = read_capture(project)
    content = capture_to_json(replace(capture, source=Path(capture.source.name)))
    photos = {view.name: _photo_name(view) for view in views if view.image}
    packed = target / project.capture_file.relative_to(project.folder)
    up = Path(os.path.relpath(target.parent, packed.parent)).as_posix()
    for entry in content["views"]:
        entry["image"] = f"{up}/{PHOTOS}/{photos[entry['name']]}" if entry["name"] in photos else None
    write_json(packed, content)
    state = {**project.state(), "capture": capture.source.name}
    state["stages"]["geometry"].setdefault("files", {})[packed.name] = checksum(packed)
    write_state(target / project.state_file.name, state)


def capture_files(path: Path, capture: Capture, photos: Path | None) -> list[PackedFile]:
    """Return the photos, cameras and splats of the capture that `path` opens.

    photos: another folder that photos may be links into. Raises BadRequest for photos outside the capture's folder, or
    linked elsewhere.
    """
    folder = _folder_of(path)
    found = []
    for photo in sorted({view.image for view in capture.views if view.image}):
        if not photo.is_relative_to(folder):
            raise BadRequest(
                f"The photo {photo} lies outside the capture's folder {folder}.", "Put capture and photos together."
            )
        found.append(_checked_picture(photo, [folder, photos]))
    splats = {capture.splats.path} if capture.splats else set()
    for file in _files_of(folder):
        if (file.suffix.lower() in CAMERA_SUFFIXES or file in splats) and not leads_out(folder, file):
            found.append(file)
    return [PackedFile(file, Path(CAPTURE, file.relative_to(folder))) for file in found]


def check_copy(path: Path, capture: Capture, target: Path) -> str:
    """Return the file to open in a copy of a capture, or an empty text. Raises DataError if the copy has other views."""
    name = "" if path.is_dir() else path.name
    if [view.name for view in open_capture(target / name).views] != [view.name for view in capture.views]:
        raise DataError(
            f"A copy of {_folder_of(path)} is another capture.", "Put its photos and camera files in one folder."
        )
    return name


def mask_files(masks: Path) -> list[PackedFile]:
    """Return the masks of a folder. Raises DataError without any, and for a link that leads out of the folder."""
    masks = masks.absolute()
    found = _files_of(check_tree(masks, masks)) if masks.is_dir() else []
    pictures = [path for path in found if path.suffix.lower() == ".png"]
    if not pictures:
        raise DataError(f"{masks} has no masks.", "Give the folder that holds <object>/<photo name>.png.")
    return [PackedFile(_checked_picture(path, [masks]), Path(MASKS, path.relative_to(masks))) for path in pictures]


def _photo_name(view: View) -> str:
    assert view.image is not None
    return f"{view.name}{view.image.suffix}"


def _checked_picture(path: Path, places: Sequence[Path | None]) -> Path:
    """Return a picture's path after checking that it, with links resolved, is in one of the folders `places`."""
    if path.exists() and all(place is None or leads_out(place, path) for place in places):
        raise BadRequest(
            f"The photo {path.resolve()} lies outside of {places[0]}.", "To pack it too, name its folder: --photos DIR."
        )
    image_header(path)
    return path


def _folder_of(path: Path) -> Path:
    path = path.absolute()
    return path if path.is_dir() else path.parent


def _files_of(folder: Path) -> list[Path]:
    """Return all files below a folder except hidden ones and those of projects and bundles; follow no links to folders."""
    found = []
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if path.is_file():
            found.append(path)
        elif is_link(path) or not path.is_dir():
            continue
        elif not (path / "project.json").exists() and not (path / "template.json").exists():
            found += _files_of(path)
    return found
