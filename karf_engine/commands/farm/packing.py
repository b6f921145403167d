"""What a bundle takes along: copies that lie beside one another, with paths that lead from one to the other."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ...capture import open_capture
from ...capture.capture import Capture, View, capture_to_json
from ...capture.reading import PHOTO_SUFFIXES
from ...errors import BadRequest, DataError
from ...io.files import checksum, write_json
from ...project import Project
from ...project.contents import capture_of
from ...project.state import write_state

PHOTOS = "photos"
ENGINE_FOLDER = Path(__file__).resolve().parents[2]


def pack_engine(target: Path) -> None:
    """Copy the engine, which a Python that has its packages can run from anywhere."""
    shutil.copytree(ENGINE_FOLDER, target / ENGINE_FOLDER.name, ignore=shutil.ignore_patterns("__pycache__"))


def pack_project(project: Project, target: Path, views: Sequence[View]) -> None:
    """Copy what rendering needs of a project.

    Args:
        project: The project, with its geometry learned.
        target: The copy's folder; photos go beside it.
        views: Captured views whose photos are taken along; the copy knows no photos of others.

    Raises:
        DataError: A file is damaged or missing.
    """
    target.mkdir()
    learned = (
        project.geometry_file,
        project.segmentation_file,
        project.segmentation_report,
        project.doubts_file,
        project.palette_file,
        project.object_colors_file,
        project.recoloring_file,
        project.splats_file,
    )
    for source in learned:
        if source.exists():
            shutil.copyfile(project.checked(source), target / source.name)
    capture = capture_of(project)
    content = capture_to_json(replace(capture, source=Path(capture.source.name)))
    photos = {view.name: _pack_photo(view, target.parent / PHOTOS) for view in views if view.image}
    for entry in content["views"]:
        photo = photos.get(entry["name"])
        entry["image"] = f"../{PHOTOS}/{photo.name}" if photo else None
    packed = target / project.capture_file.name
    write_json(packed, content)
    state = project.state() | {"capture": capture.source.name}
    state["stages"]["geometry"].setdefault("files", {})[packed.name] = checksum(packed)
    write_state(target / project.state_file.name, state)


def pack_capture(path: Path, capture: Capture, target: Path) -> str:
    """Copy a capture's folder: its photos, and all files in it that are none.

    Args:
        path: The capture's folder or file, as `open_capture` takes it.
        capture: What it holds.
        target: The copy's folder.

    Returns:
        What to open in the copy; empty for the folder itself.

    Raises:
        BadRequest: A photo lies outside the capture's folder.
        DataError: The copy would be another capture.
    """
    path = path.absolute()
    folder = path if path.is_dir() else path.parent
    photos = {view.image for view in capture.views if view.image}
    for photo in sorted(photos):
        if not photo.is_relative_to(folder):
            raise BadRequest(
                f"The photo {photo} lies outside the capture's folder {folder}.", "Put capture and photos together."
            )
    for source in _files_of(folder):
        if source.suffix.lower() not in PHOTO_SUFFIXES or source in photos:
            _copy(source, target / source.relative_to(folder))
    name = "" if path.is_dir() else path.name
    if [view.name for view in open_capture(target / name).views] != [view.name for view in capture.views]:
        raise DataError(f"A copy of {folder} is another capture.", "Put its photos and camera files in one folder.")
    return name


def pack_masks(masks: Path, target: Path) -> None:
    """Copy a folder of masks, `<object>/<photo stem>.png`. Raises DataError where it holds none."""
    pictures = [path for path in _files_of(masks) if path.suffix.lower() == ".png"] if masks.is_dir() else []
    if not pictures:
        raise DataError(f"{masks} has no masks.", "Give the folder that holds <object>/<photo name>.png.")
    for source in pictures:
        _copy(source, target / source.relative_to(masks))


def _pack_photo(view: View, folder: Path) -> Path:
    photo = folder / f"{view.name}{view.image.suffix}"
    _copy(view.image, photo)
    return photo


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        shutil.copyfile(source, target)
    except FileNotFoundError as error:
        raise DataError(f"{source} is missing.", "Bring it back, or choose other views.") from error


def _files_of(folder: Path) -> list[Path]:
    """All files below a folder but hidden ones, and those of projects and bundles that lie in it."""
    found = []
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if path.is_file():
            found.append(path)
        elif not (path / "project.json").exists() and not (path / "template.json").exists():
            found += _files_of(path)
    return found
