"""Find files whose names programs, disks and archives write differently.

A name matches exactly, else in another Unicode form or case, else, for photos, by its stem. The first of these levels with
a match decides; several matches on one level are refused, because only the user knows which file is meant.
"""

from __future__ import annotations

import os
import re
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath

from ..errors import DataError
from .image_size import RAW_SUFFIXES
from .names import case_folded

HEIC_SUFFIXES = (".heic", ".heif")
PHOTO_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp", ".exr", *HEIC_SUFFIXES, ".avif")
ANY_SUFFIX = re.compile(r"\.[a-z][a-z0-9]{1,4}$", re.IGNORECASE)  # not the number of a frame
REDUCED = re.compile(r"_(\d+)$")  # images_4: photos at a quarter of their size
MASK_ENDINGS = ("_mask", ".mask", "-mask")


def is_photo(path: Path | PurePosixPath) -> bool:
    """Test whether a path has the suffix of a photo."""
    return path.suffix.lower() in PHOTO_SUFFIXES


def photo_stem(name: str) -> str:
    """Return a photo's file name without its suffix; a name that ends otherwise stays."""
    return ANY_SUFFIX.sub("", name) or name


def mask_stems(name: str) -> list[str]:
    """Return the names that a mask's photo may have, likeliest first.

    Examples:
        >>> mask_stems("pot_01.png"), mask_stems("pot_01.jpg.png"), mask_stems("pot_01_mask.png")
        (['pot_01'], ['pot_01.jpg', 'pot_01'], ['pot_01_mask', 'pot_01'])
    """
    stems = [Path(name).stem]
    while True:
        last = stems[-1]
        shorter = last[: -len(Path(last).suffix)] if is_photo(Path(last)) else last
        for ending in MASK_ENDINGS:
            if last.lower().endswith(ending):
                shorter = last[: -len(ending)]
        if shorter in ("", last):
            return stems
        stems.append(shorter)


def find_entry(folder: Path, name: str) -> Path:
    """Return the path of a file or folder in `folder`, whatever case and Unicode form its name has there.

    If there is none, the path has the name as given. Raises DataError if several names match and none exactly.
    """
    path = folder / name
    if _exists(path):
        return path
    return _single(_Listing(folder).entries.get(case_folded(name), []), path) or path


class FileFinder:
    """Finds files below a folder by relative paths; folders are listed once."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self._listings: dict[Path, _Listing] = {}
        self._exact_listings: dict[tuple[str, ...], _Listing] = {}
        self._exact: dict[tuple[str, ...], Path | None] = {}

    def exact(self, path: PurePosixPath) -> Path | None:
        """Return the file at a path, or the photo whose name continues a path without suffix."""
        parts = path.parts
        if parts not in self._exact:
            self._exact[parts] = self._find_exact(parts[:-1], parts[-1])
        return self._exact[parts]

    def matches(self, path: PurePosixPath) -> list[Path]:
        """Return the files that a path may mean: those of the strictest level that has any."""
        if exact := self.exact(path):
            return [exact]
        folder = self.root
        for part in path.parts[:-1]:
            folder = self._folder(folder, part)
        listing = self._listing(folder)
        alike = [found for found in listing.entries.get(case_folded(path.name), []) if found.is_file()]
        return alike or listing.photos.get(case_folded(photo_stem(path.name)), [])

    def find(self, path: PurePosixPath) -> Path | None:
        """Return the file that a path means; None if there is none. Raises DataError if it may be several files."""
        return self.exact(path) or _single(self.matches(path), self.root / path)

    def _find_exact(self, folders: tuple[str, ...], name: str) -> Path | None:
        if folders not in self._exact_listings:
            self._exact_listings[folders] = self._listing(self.root.joinpath(*folders))
        listing = self._exact_listings[folders]
        if name in listing.files:
            return listing.readable_copy(name) or listing.folder / name
        if not listing.files or is_photo(PurePosixPath(name)):
            return None
        continued = listing.photos.get(case_folded(name), [])
        return continued[0] if len(continued) == 1 else None

    def _listing(self, folder: Path) -> _Listing:
        if folder not in self._listings:
            self._listings[folder] = _Listing(folder)
        return self._listings[folder]

    def _folder(self, folder: Path, part: str) -> Path:
        """Return the folder that a part of a path means, or the largest of its reduced copies such as images_2."""
        if (folder / part).is_dir():
            return folder / part
        listing = self._listing(folder)
        alike = [path for path in listing.entries.get(case_folded(part), []) if path.is_dir()]
        return _single(alike, folder / part) or listing.reduced(part) or folder / part


@dataclass(frozen=True)
class _Listing:
    """The names in a folder; none if it cannot be listed."""

    folder: Path

    @cached_property
    def _scanned(self) -> list[os.DirEntry]:
        try:
            with os.scandir(self.folder) as entries:
                return sorted(entries, key=lambda entry: entry.name)
        except (OSError, ValueError):  # also names that the file system cannot have
            return []

    @cached_property
    def files(self) -> set[str]:
        return {entry.name for entry in self._scanned if entry.is_file()}

    @cached_property
    def entries(self) -> dict[str, list[Path]]:
        """Files and folders by case-folded name."""
        return _grouped((case_folded(entry.name), Path(entry.path)) for entry in self._scanned)

    @cached_property
    def photos(self) -> dict[str, list[Path]]:
        """Photos by case-folded stem; hidden ones are left out."""
        paths = (self.folder / name for name in sorted(self.files) if not name.startswith("."))
        return _grouped((case_folded(path.stem), path) for path in paths if is_photo(path))

    def readable_copy(self, name: str) -> Path | None:
        """Return the photo made of a HEIC or raw file, beside it; None if there is none."""
        if not name.lower().endswith((*HEIC_SUFFIXES, *RAW_SUFFIXES)):
            return None
        copies = self.photos.get(case_folded(photo_stem(name)), [])
        return next((path for path in copies if not path.name.lower().endswith(HEIC_SUFFIXES)), None)

    def reduced(self, name: str) -> Path | None:
        """Return the folder `name`_N with the smallest N."""
        copies = [
            (int(number[1]), Path(entry.path))
            for entry in self._scanned
            if (number := REDUCED.search(entry.name)) and entry.is_dir()
            if case_folded(entry.name[: number.start()]) == case_folded(name)
        ]
        return min(copies)[1] if copies else None


def _grouped(pairs: Iterable[tuple[str, Path]]) -> dict[str, list[Path]]:
    groups = defaultdict(list)
    for key, path in pairs:
        groups[key].append(path)
    return groups


def _single(candidates: list[Path], wanted: Path) -> Path | None:
    if len(candidates) > 1:
        raise DataError(
            "{path} may be {first} or {second}.",
            "Remove or rename one of them.",
            path=wanted,
            first=candidates[0].name,
            second=candidates[1].name,
        )
    return candidates[0] if candidates else None


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):
        return False
