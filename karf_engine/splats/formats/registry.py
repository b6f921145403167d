"""Formats of Gaussian files by file extension."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import BadRequest
from ...io.inputs import check_file
from ...io.limited import run_limited
from ...io.ply import MOST_HEADER
from . import compressed_ply, gltf, ply, sog, splat, spz, usd
from .splat_file import SplatFile

PARTS = ("table", "is_antialiased")


@dataclass(frozen=True)
class Kind:
    """A file format.

    Attributes:
        ends: File extensions.
        read: Reads a path.
        write: Writes a path; None for read-only formats.
        is_limited: Whether a third-party decoder reads it, in a child process with limits; such formats have no columns.
    """

    ends: tuple[str, ...]
    read: Callable[[Path], SplatFile]
    write: Callable[[Path, SplatFile], None] | None = None
    is_limited: bool = True


COMPRESSED_PLY = Kind((".compressed.ply",), compressed_ply.read, compressed_ply.write)
PLAIN_PLY = Kind((".ply",), ply.read, ply.write, is_limited=False)
KINDS = (
    COMPRESSED_PLY,  # before the shorter extension
    PLAIN_PLY,
    Kind((".spz",), spz.read, spz.write),
    Kind((".glb", ".gltf"), gltf.read, gltf.write, is_limited=False),
    Kind((".usda", ".usdc", ".usd"), usd.read, usd.write),
    Kind((".usdz",), usd.read),
    Kind((".sog",), sog.read),
    Kind((".splat",), splat.read, is_limited=False),
)
WRITTEN = tuple(kind for kind in KINDS if kind.write)


def read_splats(path: Path) -> SplatFile:
    """Read a file of Gaussians. Its extension decides the format; PLY is compressed or plain by its header.

    Raises:
        BadRequest: The extension is unknown.
        DataError: The file is missing or damaged, a row is not a Gaussian, or reading takes too much memory or time.
        MissingDependency: A package of this format is not installed.
    """
    kind = _kind_to_read(path)
    if not kind.is_limited:
        return kind.read(path)
    table, is_antialiased = run_limited(arrays_of, path, PARTS)
    return SplatFile(table, bool(is_antialiased[0]) if len(is_antialiased) else None)


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    """Return table and `is_antialiased` ([1] bool, or [0] for None) of a file without columns."""
    splats = _kind_to_read(path).read(path)
    is_antialiased = [] if splats.is_antialiased is None else [splats.is_antialiased]
    return dict(zip(PARTS, (splats.table, np.array(is_antialiased, bool)), strict=True))


def _kind_to_read(path: Path) -> Kind:
    kind = _kind(path, KINDS)
    if kind in (PLAIN_PLY, COMPRESSED_PLY):
        return PLAIN_PLY if is_plain_ply(path) else COMPRESSED_PLY
    return kind


def is_plain_ply(path: Path) -> bool:
    """Return whether this is a PLY file that is not compressed. Raises DataError for a missing .ply file."""
    if path.suffix.lower() != ".ply":
        return False
    check_file(path)
    with path.open("rb") as stream:
        return not compressed_ply.is_compressed(stream.read(MOST_HEADER))


def write_splats(path: Path, splats: SplatFile) -> None:
    """Write Gaussians atomically in the format of the extension; columns only as .ply.

    Raises:
        BadRequest: No format can be written with this extension, or centers are out of its range.
        MissingDependency: A package of this format is not installed.
        OSError: The disk is full, or the folder cannot be written.
    """
    write = _kind(path, WRITTEN).write
    assert write is not None
    write(path, splats)


def end_of(path: Path) -> str:
    """Return the file extension, such as `.compressed.ply`. Raises BadRequest where no format is written with it."""
    name = path.name.lower()
    return next(end for end in _kind(path, WRITTEN).ends if name.endswith(end))


def _kind(path: Path, kinds: tuple[Kind, ...]) -> Kind:
    name = path.name.lower()
    for kind in kinds:
        if name.endswith(kind.ends):
            return kind
    ends = ", ".join(end for kind in kinds for end in kind.ends)
    raise BadRequest(f"{path} has none of the ends {ends}.", "Give the file a name with one of them.")
