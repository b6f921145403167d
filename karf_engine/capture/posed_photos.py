"""Photos that a photogrammetry program's file names, each with a camera at the photo's size: shared by all readers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from ..errors import DataError
from ..io.matching import FileFinder
from .camera import Camera
from .capture import Capture
from .reader_utils import at_size, make_views, merge_notes, photo_size, read_each

PHOTO_FOLDERS = ("", "images", "photos", "input", "rgb")


@dataclass(frozen=True)
class PosedPhoto:
    """A photo as a camera file names it.

    Attributes:
        path: Relative path; a name without suffix means the photo of that stem.
        camera: Makes the camera from the photo's width and height. Raises DataError.
        size: Width and height that the file declares; None if it declares none.
    """

    path: PurePosixPath
    camera: Callable[[int, int], Camera]
    size: tuple[int, int] | None = None


def read_posed(
    source: Path, format_name: str, photos: Sequence[PosedPhoto], folder: Path, with_photos: bool, remarks: list[str]
) -> Capture:
    """Find the photos below `folder` and return the capture, or bare cameras without photos.

    Missing and damaged photos are left out with a remark. Raises DataError if none can be read, or two have one name.
    """
    found = _find(source, folder, photos) if with_photos else [None] * len(photos)
    pairs = [(photo, file) for photo, file in zip(photos, found, strict=True) if file or not with_photos]
    if len(pairs) < len(photos):
        missing = next(photo.path for photo, file in zip(photos, found, strict=True) if not file)
        count = len(photos) - len(pairs)
        remarks = [*remarks, f"{count} of {len(photos)} photos are missing and were skipped; the first is {missing}."]

    def read(pair: tuple[PosedPhoto, Path | None]) -> tuple[Camera, list[str]]:
        photo, file = pair
        size = photo_size(file, photo.size) if file else photo.size
        if size is None:
            raise DataError(f"{source} declares no picture size of {photo.path}.", "Open it together with its photos.")
        return at_size(photo.camera(*(photo.size or size)), size)

    results, skip_remarks = read_each(pairs, lambda pair: (*pair, *read(pair)), skip=with_photos)
    stems = [file.stem if file else photo.path.stem for photo, file, _, _ in results]
    files = [file for _, file, _, _ in results]
    views = make_views([camera for _, _, camera, _ in results], files, stems, ["train"] * len(results))
    notes = merge_notes(note for *_, notes in results for note in notes)
    return Capture(source.absolute(), format_name, tuple(views), (*remarks, *skip_remarks, *notes))


def _find(source: Path, folder: Path, photos: Sequence[PosedPhoto]) -> list[Path | None]:
    """Return the file of each photo, all from the usual folder that has the most: first by paths, then by unique names."""
    paths = [photo.path for photo in photos]
    flat = [PurePosixPath(path.name) for path in paths]
    repeated = next((path for path, count in Counter(paths).items() if count > 1), None)
    if repeated is not None:
        raise DataError(
            "{path} has several photos called {name}.",
            "Give each photo a name of its own, and export the cameras again.",
            path=source,
            name=repeated,
        )
    children = sorted(child.name for child in folder.iterdir() if child.is_dir() and child.name not in PHOTO_FOLDERS)
    for wanted in (paths, flat) if len(set(flat)) == len(flat) else (paths,):
        finders = [FileFinder(folder / name) for name in (*PHOTO_FOLDERS, *children)]
        counts = [sum(bool(finder.matches(path)) for path in wanted) for finder in finders]
        if any(counts):
            best = finders[counts.index(max(counts))]
            return [best.find(path) for path in wanted]
    raise DataError(
        "{path}: none of its {count} photos was found, the first are {first}.",
        "Put the photos into {folder}, by the names that the file has.",
        path=source,
        count=len(photos),
        first=", ".join(map(str, paths[:3])),
        folder=folder / "images",
    )
