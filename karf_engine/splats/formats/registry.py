"""Formats of Gaussian files by file extension."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...capture.camera import Camera
from ...capture.capture import CapturedSplats
from ...capture.reader_utils import read_bytes
from ...compute.progress import Emit
from ...errors import BadRequest
from ...io.files import check_file
from ...io.limited import run_limited
from ...io.ply import MOST_HEADER, read_header
from ..gaussians import Gaussians, imported_gaussians
from ..kernels.arrays import C0
from . import gltf, packed, ply, sog, usd
from .splat_file import SplatFile, damaged, log_scales, logits, usable

PARTS = ("table", "is_antialiased", "n_skipped")
SPLAT_ROW = np.dtype(
    [("center", "<f4", 3), ("scales", "<f4", 3), ("color", "u1", 3), ("opacity", "u1"), ("rotation", "u1", 4)]
)
HALF_BYTE = 128


def read_splat(path: Path) -> SplatFile:
    """Read Gaussians of antimatter15's .splat (github.com/antimatter15/splat, main.js).

    32 bytes per Gaussian, no header, degree 0 only, axes of PLY; a quaternion of four bytes 128 is the identity.
    Precision: float32 for centers and scales, 1/510 for opacity and color, 1/256 for quaternions.
    """
    data = read_bytes(path)
    if len(data) % SPLAT_ROW.itemsize:
        raise damaged(path, f"it has {len(data):,} bytes, which is no multiple of {SPLAT_ROW.itemsize}")
    rows = np.frombuffer(data, SPLAT_ROW)
    rotations = rows["rotation"].astype(np.float64) - HALF_BYTE
    rotations[~rotations.any(1), 0] = 1
    colors = (rows["color"] / 255 - 0.5) / C0
    parts = (rows["center"], log_scales(rows["scales"]), rotations / HALF_BYTE, logits(rows["opacity"] / 255)[:, None])
    return usable(path, np.concatenate([*parts, colors], 1))


@dataclass(frozen=True)
class Kind:
    """A file format."""

    ends: tuple[str, ...]  # file extensions
    read: Callable[[Path], SplatFile]
    write: Callable[[Path, SplatFile], None] | None = None  # None for read-only formats
    is_limited: bool = True  # content is compressed or nested: a child process with limits decodes it; no columns


COMPRESSED_PLY = Kind((".compressed.ply",), packed.read_compressed_ply, packed.write_compressed_ply)
SPZ = Kind((".spz",), packed.read_spz, packed.write_spz)
PLAIN_PLY = Kind((".ply",), ply.read, ply.write, is_limited=False)
KINDS = (
    COMPRESSED_PLY,  # before the shorter extension
    PLAIN_PLY,
    SPZ,
    Kind((".glb", ".gltf"), gltf.read, gltf.write),
    Kind((".usda", ".usdc", ".usd"), usd.read, usd.write),
    Kind((".sog",), sog.read, sog.write),
    Kind((".usdz",), usd.read),
    Kind((".splat",), read_splat, is_limited=False),
)
WRITTEN = tuple(kind for kind in KINDS if kind.write)


def read_splats(path: Path) -> SplatFile:
    """Read a file of Gaussians. Its extension decides the format; PLY is compressed or plain by its header.

    Raises BadRequest for an unknown extension, DataError for a damaged file or one that takes too much memory or time,
    and MissingDependency.
    """
    kind = _kind_to_read(path)
    if not kind.is_limited:
        return kind.read(path)
    table, is_antialiased, n_skipped = run_limited(arrays_of, path, PARTS)
    return SplatFile(table, bool(is_antialiased[0]) if len(is_antialiased) else None, n_skipped=int(n_skipped))


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    """Read a file in this process; return table, `is_antialiased` ([1] bool, or [0] for None) and `n_skipped`."""
    splats = _kind_to_read(path).read(path)
    is_antialiased = [] if splats.is_antialiased is None else [splats.is_antialiased]
    values = (splats.table, np.array(is_antialiased, bool), np.array(splats.n_skipped))
    return dict(zip(PARTS, values, strict=True))


def read_captured_gaussians(splats: CapturedSplats, cameras: Sequence[Camera], emit: Emit) -> Gaussians:
    """Read the Gaussians of a capture, over black; warn of skipped rows. Raises as `read_splats`.

    cameras: of the capture.
    """
    found = read_splats(splats.path)
    warn_of_skipped(found, splats.path, emit)
    return imported_gaussians(found.table, splats.is_antialiased, cameras)


def warn_of_skipped(splats: SplatFile, path: Path, emit: Emit) -> None:
    """Emit a warning where rows of the file were skipped."""
    remark = splats.remark(path)
    if remark is not None:
        emit("warning", code="splats", sentence=remark)


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
        start = stream.read(MOST_HEADER)
    try:
        return "chunk" not in read_header(start).elements
    except ValueError:
        return True


def write_splats(path: Path, splats: SplatFile, spz_version: int = 3) -> None:
    """Write Gaussians atomically in the format of the extension; columns only as .ply. spz_version: see `write_spz`.

    Raises BadRequest for an unknown extension or centers out of its range, and MissingDependency.
    """
    kind = _kind(path, WRITTEN)
    if kind is SPZ:
        packed.write_spz(path, splats, spz_version)
        return
    assert kind.write is not None
    kind.write(path, splats)


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
    raise BadRequest(
        f"{path} has none of the ends {ends}.",
        "Give the file a name with one of them; convert other kinds of splats to .ply, for example with SuperSplat.",
    )
