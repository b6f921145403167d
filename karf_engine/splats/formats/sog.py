"""Gaussians in .sog archives of PlayCanvas ("Spatially Ordered Gaussians", developer.playcanvas.com), version 2.

A zip archive of meta.json and lossless WebP pictures with one pixel per Gaussian, in the axes of PLY. gsply reads it, in a
child process with limits of memory and time (see `registry`); only what it takes for granted is checked here.

Precision: 16 bits for the logarithm of a center's coordinate in the scene's bounds; codebooks of 256 values for scales,
colors and harmonics; 1/510 for opacity; 0.006 for quaternions. Above 65,536 Gaussians, alike ones share their harmonics.
"""

from __future__ import annotations

import io
import json
import warnings
import zipfile
from pathlib import Path

import numpy as np

from ...capture.reader_utils import read_bytes
from ...io.files import atomic_write
from ...version import __version__
from ..gaussians import DEGREES
from ..kernels.arrays import COLOR, LOG_SCALE, LOGIT, ROTATION
from .packed import from_package, morton_order
from .splat_file import SplatFile, damaged, explaining, needing_packages, opacities, unit_rotations, usable

VERSION, META = 2, "meta.json"
CODES = 256  # of a codebook
BINS = 1024  # of the histogram that a codebook starts from
ROUNDS = 5  # of k-means
PALETTE, GROUPS = 1 << 16, 256  # most harmonics; groups that k-means first makes of them
PALETTE_WIDTH = 64  # entries in a row of the palette's picture
OPAQUE = 255
LARGEST = 252  # the fourth channel of a rotation is this and the place of its largest component, which is left out


def read(path: Path) -> SplatFile:
    """Read Gaussians of a .sog archive."""
    data = read_bytes(path)
    with explaining(path):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            meta = json.loads(archive.read(META))
        if meta.get("version") != VERSION:
            raise damaged(path, f"it is of version {meta.get('version', 1)!r}, where {VERSION} is read")
        if type(meta["count"]) is not int:
            raise ValueError(f"{str(meta['count'])[:40]!r} is no whole number")
        for part in {"scales", "sh0", "shN"} & meta.keys():
            if np.array(meta[part]["codebook"], np.float32).shape != (CODES,):
                raise ValueError(f"{CODES} numbers were expected in the codebook of {part}")
        import imagecodecs  # noqa: F401  gsply reads pictures with it
        from gsply import sogread

        table = from_package(sogread(data))  # pyright: ignore
    is_antialiased = meta.get("antialias")
    return usable(path, table, is_antialiased if isinstance(is_antialiased, bool) else None)


def write(path: Path, splats: SplatFile) -> None:
    """Write Gaussians as a .sog archive, in `morton_order`; columns are dropped."""
    with needing_packages():
        from imagecodecs import webp_encode

        meta, pictures = _encoded(splats.table[morton_order(splats.table)])
        meta["antialias"] = bool(splats.is_antialiased)
        members = {name: webp_encode(picture, lossless=True) for name, picture in pictures.items()}

    def write_archive(temporary: Path) -> None:
        with zipfile.ZipFile(temporary, "w") as archive:
            for name, content in {META: json.dumps(meta), **members}.items():
                archive.writestr(zipfile.ZipInfo(name), content)

    atomic_write(path, write_archive)


def _encoded(table: np.ndarray) -> tuple[dict, dict[str, np.ndarray]]:
    """Return the content of meta.json, and the pictures by file name."""
    centers = table[:, :LOG_SCALE].astype(np.float64)
    centers = np.sign(centers) * np.log1p(np.abs(centers))
    low, high = centers.min(0), centers.max(0)
    places = np.round((centers - low) / np.where(high > low, high - low, 1) * 65535).astype(np.uint16)
    scales, scale_codes = _coded(table[:, LOG_SCALE:ROTATION])
    colors, color_codes = _coded(table[:, COLOR : COLOR + 3])
    alphas = np.round(opacities(table[:, LOGIT:COLOR]) * 255)
    pictures = {
        "means_l.webp": _picture(places & 255),
        "means_u.webp": _picture(places >> 8),
        "scales.webp": _picture(scales),
        "quats.webp": _picture(_smallest_three(unit_rotations(table))),
        "sh0.webp": _picture(np.concatenate([colors, alphas], 1)),
    }
    meta = {
        "version": VERSION,
        "asset": {"generator": f"KaRF {__version__}"},
        "count": len(table),
        "means": {"mins": low.tolist(), "maxs": high.tolist(), "files": ["means_l.webp", "means_u.webp"]},
        "scales": {"codebook": scale_codes, "files": ["scales.webp"]},
        "quats": {"files": ["quats.webp"]},
        "sh0": {"codebook": color_codes, "files": ["sh0.webp"]},
    }
    n_rest = (table.shape[1] - COLOR) // 3 - 1
    if n_rest:
        numbers, palette = _palette(table[:, COLOR + 3 :])
        entries, codes = _coded(palette)
        pictures["shN_centroids.webp"] = _palette_picture(entries.reshape(len(entries), n_rest, 3))
        pictures["shN_labels.webp"] = _picture(np.stack([numbers & 255, numbers >> 8, 0 * numbers], 1))
        meta["shN"] = {"count": len(palette), "bands": DEGREES[n_rest + 1], "codebook": codes,
                       "files": ["shN_centroids.webp", "shN_labels.webp"]}  # fmt: skip
    return meta, pictures


def _coded(values: np.ndarray) -> tuple[np.ndarray, list[float]]:
    """Return the code of each value, and the value of each code: k-means in one dimension (S. Lloyd, 1982)."""
    ordered = np.sort(values, axis=None).astype(np.float64)
    sums = np.concatenate([[0], np.cumsum(ordered)])
    counts, edges = np.histogram(ordered, BINS)
    density = np.cbrt(counts)  # of the codes with the least mean error (Panter and Dite, 1951)
    density += density.mean()  # half of them evenly, for rare values
    codes = np.interp(np.linspace(0, 1, CODES), np.append(0, np.cumsum(density)) / density.sum(), edges)
    for _ in range(ROUNDS):
        inner = np.searchsorted(ordered, (codes[1:] + codes[:-1]) / 2)
        ends = np.concatenate([[0], inner, [len(ordered)]])
        counts = np.diff(ends)
        codes = np.where(counts, np.diff(sums[ends]) / np.maximum(counts, 1), codes)
    return np.searchsorted((codes[1:] + codes[:-1]) / 2, values).astype(np.uint8), codes.tolist()


def _palette(harmonics: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return for each row of harmonics [n, c] the number of its entry [n], and the entries [m, c], by k-means in two steps."""
    if len(harmonics) <= PALETTE:
        return np.arange(len(harmonics)), harmonics
    from scipy.cluster.vq import kmeans2  # slow to import

    def clustered(rows: np.ndarray, n_entries: int) -> tuple[np.ndarray, np.ndarray]:
        with warnings.catch_warnings(action="ignore", category=UserWarning):  # an entry without rows does no harm
            return kmeans2(rows, n_entries, ROUNDS, minit="points", rng=0)

    numbers, entries, count = np.empty(len(harmonics), np.int64), [], 0
    _, groups = clustered(harmonics, GROUPS)
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        n_entries = max(1, len(rows) * (PALETTE - GROUPS) // len(harmonics))
        centers, own = clustered(harmonics[rows], n_entries)
        numbers[rows] = own + count
        entries.append(centers)
        count += len(centers)
    return numbers, np.concatenate(entries)


def _smallest_three(rotations: np.ndarray) -> np.ndarray:
    """Return bytes [n, 4] of unit quaternions w x y z [n, 4]."""
    largest = np.abs(rotations).argmax(1)[:, None]
    rotations = rotations * np.where(np.take_along_axis(rotations, largest, 1) < 0, -1, 1)
    others = rotations[np.arange(4) != largest].reshape(-1, 3)
    return np.concatenate([np.round((others * np.sqrt(2) + 1) / 2 * 255), LARGEST + largest], 1)


def _picture(values: np.ndarray) -> np.ndarray:
    """Return a picture [h, w, 4] uint8 of values [n, 3] or [n, 4], row by row."""
    width = int(np.ceil(np.sqrt(len(values)) / 4)) * 4
    height = -(-len(values) // (4 * width)) * 4
    pixels = np.full((height * width, 4), OPAQUE, np.uint8)
    pixels[: len(values), : values.shape[1]] = values
    return pixels.reshape(height, width, 4)


def _palette_picture(entries: np.ndarray) -> np.ndarray:
    """Return the picture of a palette's codes [m, coefficients, 3]."""
    height = -(-len(entries) // PALETTE_WIDTH)
    pixels = np.full((height * PALETTE_WIDTH, entries.shape[1], 4), OPAQUE, np.uint8)
    pixels[: len(entries), :, :3] = entries
    return pixels.reshape(height, -1, 4)
