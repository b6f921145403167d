"""PlayCanvas' SOG: a zip archive of pictures with one pixel per Gaussian. Read only.

Format: developer.playcanvas.com, "The SOG Format", version 2: meta.json, lossless WebP pictures, codebooks of 256 values.
gsply unpacks, after the checks below. Axes are those of PLY.

Precision: 16 bits for the logarithm of a center's coordinate in the scene's bounds, codebooks for scales and colors,
1/510 for opacity, 0.006 for quaternions.
"""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ...capture.reader_utils import read_bytes
from ...io.image_size import webp_size
from ...io.inputs import MAX_JSON_BYTES
from .checking import check_count, checked, damaged, explaining
from .packed import from_package
from .splat_file import SplatFile

VERSION = 2
META = "meta.json"
CODES = 256
PALETTE_WIDTH = 64  # entries per row of the picture of harmonics
PALETTE = 1 << 16  # entries, at most
N_HARMONICS = {1: 3, 2: 8, 3: 15}  # above degree 0, by degree
SPARE = 4096  # pixels; a picture may have 1.5 n + SPARE for n Gaussians


def read(path: Path) -> SplatFile:
    """Read Gaussians of a .sog archive.

    Raises:
        DataError: The file is missing, damaged, of another version, or a row is not a Gaussian.
        MissingDependency: gsply or imagecodecs is not installed.
    """
    data = read_bytes(path)
    with explaining(path):
        members = _members(path, data)
        meta = json.loads(members[META])
        _check(path, meta, members, len(data))
        import imagecodecs  # noqa: F401  gsply reads pictures with it
        from gsply import sogread

        archive = io.BytesIO()
        with zipfile.ZipFile(archive, "w") as file:
            for name in (META, *_pictures(meta)):
                file.writestr(name, members[name])
        table = from_package(sogread(archive.getvalue()))  # pyright: ignore
    is_antialiased = meta.get("antialias")
    return SplatFile(checked(path, table), is_antialiased if isinstance(is_antialiased, bool) else None)


def _members(path: Path, data: bytes) -> dict[str, bytes]:
    """Return the archive's files by name. Pictures are stored uncompressed, which bounds their total size."""
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        if sum(member.file_size for member in file.infolist()) > len(data) + MAX_JSON_BYTES:
            raise damaged(path, "its members are larger than itself")
        return {member.filename: file.read(member) for member in file.infolist() if not member.is_dir()}


def _pictures(meta: dict[str, Any]) -> list[str]:
    parts = ("means", "quats", "scales", "sh0", *(("shN",) if "shN" in meta else ()))
    return [name for part in parts for name in meta[part]["files"]]


def _check(path: Path, meta: dict[str, Any], members: dict[str, bytes], size: int) -> None:
    """Refuse what gsply would compute with, or read beyond an array's end."""
    if meta.get("version") != VERSION:
        raise damaged(path, f"it is of version {meta.get('version', 1)!r}, where {VERSION} is read")
    count = _whole(meta["count"])
    n_harmonics = 1 + N_HARMONICS[_whole(meta["shN"]["bands"])] if "shN" in meta else 1
    check_count(path, count, n_harmonics, size)
    for values, length in (
        (meta["means"]["mins"], 3),
        (meta["means"]["maxs"], 3),
        (meta["scales"]["codebook"], CODES),
        (meta["sh0"]["codebook"], CODES),
    ):
        _numbers(values, length)
    for part, n_pictures in (("means", 2), ("quats", 1), ("scales", 1), ("sh0", 1)):
        for name in _names(meta[part]["files"], n_pictures):
            _check_picture(path, name, members[name], count)
    if "shN" not in meta:
        return
    harmonics = meta["shN"]
    _numbers(harmonics["codebook"], CODES)
    entries, width = _whole(harmonics["count"]), PALETTE_WIDTH * (n_harmonics - 1)
    centroids, labels = _names(harmonics["files"], 2)
    _check_picture(path, labels, members[labels], count)
    found = webp_size(members[centroids])
    if (
        found[0] != width
        or not 0 < entries <= min(PALETTE, PALETTE_WIDTH * found[1])
        or found[1] > PALETTE // PALETTE_WIDTH
    ):
        raise damaged(path, f"{centroids} has {found[0]}x{found[1]} pixels for {entries} entries")


def _check_picture(path: Path, name: str, data: bytes, count: int) -> None:
    width, height = webp_size(data)
    if not count <= width * height <= count * 1.5 + SPARE:
        raise damaged(path, f"{name} has {width}x{height} pixels for {count:,} Gaussians")


def _whole(value: Any) -> int:
    if type(value) is not int:
        raise ValueError(f"{str(value)[:40]!r} is no whole number")
    return value


def _numbers(values: Any, count: int) -> None:
    found = np.array(values, np.float32)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise ValueError(f"{count} finite numbers were expected in {META}")


def _names(values: Any, count: int) -> list[str]:
    if not isinstance(values, list) or len(values) != count or not all(isinstance(name, str) for name in values):
        raise ValueError(f"{count} names of pictures were expected in {META}")
    return values
