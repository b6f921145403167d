"""The kinds of files of Gaussians, by the ends of their names."""

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
    """One kind of files.

    Attributes:
        ends: Of the names.
        read: Of a path.
        write: To a path; None where it is only read.
        is_limited: Whether others' decoders read it, in a child process with limits; none of these kinds has columns.
    """

    ends: tuple[str, ...]
    read: Callable[[Path], SplatFile]
    write: Callable[[Path, SplatFile], None] | None = None
    is_limited: bool = True


COMPRESSED_PLY = Kind((".compressed.ply",), compressed_ply.read, compressed_ply.write)
PLAIN_PLY = Kind((".ply",), ply.read, ply.write, is_limited=False)
KINDS = (
    COMPRESSED_PLY,  # before the shorter end
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
    """Read Gaussians of another program, of the kind that the name's end tells; whether PLY is packed, the content.

    Raises:
        BadRequest: No kind has this end.
        DataError: The file is missing or damaged, a row cannot be a Gaussian, or reading it takes too much memory or time.
        MissingDependency: A package that this kind needs is not installed.
    """
    kind = _kind_to_read(path)
    if not kind.is_limited:
        return kind.read(path)
    table, said = run_limited(arrays_of, path, PARTS)
    return SplatFile(table, bool(said[0]) if len(said) else None)


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    """What `read_splats` gives of a file without columns, as arrays: `is_antialiased` [1] bool, or [0]."""
    splats = _kind_to_read(path).read(path)
    is_antialiased = [] if splats.is_antialiased is None else [splats.is_antialiased]
    return dict(zip(PARTS, (splats.table, np.array(is_antialiased, bool)), strict=True))


def _kind_to_read(path: Path) -> Kind:
    kind = _kind(path, KINDS)
    if kind in (PLAIN_PLY, COMPRESSED_PLY):
        return PLAIN_PLY if is_plain_ply(path) else COMPRESSED_PLY
    return kind


def is_plain_ply(path: Path) -> bool:
    """Whether this is a PLY file by the name's end, and not a compressed one by the content.

    Raises:
        DataError: It has this end and is missing, or no file.
    """
    if path.suffix.lower() != ".ply":
        return False
    check_file(path)
    with path.open("rb") as stream:
        return not compressed_ply.is_compressed(stream.read(MOST_HEADER))


def write_splats(path: Path, splats: SplatFile) -> None:
    """Write Gaussians atomically, as the kind that the name's end tells; columns only as .ply.

    Raises:
        BadRequest: No kind that is written has this end, or this kind cannot hold centers that are so far.
        MissingDependency: A package that this kind needs is not installed.
        OSError: The disk takes no more, or the folder cannot be written.
    """
    kind = _kind(path, WRITTEN)
    kind.write(path, splats)


def end_of(path: Path) -> str:
    """The end of the name that says its kind of file, such as `.compressed.ply`.

    Raises:
        BadRequest: No kind that is written has it.
    """
    name = path.name.lower()
    return next(end for end in _kind(path, WRITTEN).ends if name.endswith(end))


def _kind(path: Path, kinds: tuple[Kind, ...]) -> Kind:
    name = path.name.lower()
    for kind in kinds:
        if name.endswith(kind.ends):
            return kind
    ends = ", ".join(end for kind in kinds for end in kind.ends)
    raise BadRequest(f"{path} has none of the ends {ends}.", "Give the file a name with one of them.")
