"""Sample files of Gaussians, writers of the formats that the engine only reads, and a comparison of tables."""

import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from blender_tests.engine.splats.clouds import GROUPS, cloud
from karf_engine.errors import DataError
from karf_engine.splats.formats.ply import property_names
from karf_engine.splats.formats.registry import arrays_of, write_splats
from karf_engine.splats.formats.splat_file import SplatFile
from karf_engine.splats.kernels.arrays import C0, COLOR, LOG_SCALE, LOGIT, ROTATION

ENDS = (".ply", ".compressed.ply", ".spz", ".glb", ".gltf", ".usda", ".usdc", ".usd")  # formats that can be written
CODES = 256


def unit_cloud(count: int = 300, degree: int = 3, seed: int = 0) -> np.ndarray:
    """A cloud with unit quaternions and positive w, as packed formats return them."""
    table = cloud(count, degree, seed)
    rotations = table[:, GROUPS["rotation"]]
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    rotations *= np.where(rotations[:, :1] < 0, -1, 1)
    return table


def distances(found: np.ndarray, wanted: np.ndarray) -> dict[str, float]:
    """The largest difference in each group of columns, comparing opacities and ignoring the sign of quaternions."""
    found, wanted = found.astype(np.float64), wanted.astype(np.float64)
    for table in (found, wanted):
        table[:, LOGIT] = 1 / (1 + np.exp(-table[:, LOGIT]))
    rotations = GROUPS["rotation"]
    found[:, rotations] *= np.sign((found[:, rotations] * wanted[:, rotations]).sum(1, keepdims=True))
    return {name: float(np.abs(found[:, group] - wanted[:, group]).max(initial=0)) for name, group in GROUPS.items()}


def write_text(path: Path, table: np.ndarray) -> None:
    names = "".join(f"property float {name}\n" for name in property_names(table.shape[1]))
    rows = "".join(" ".join(map(repr, row)) + "\n" for row in table.astype(float).tolist())
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex {len(table)}\n{names}end_header\n{rows}")


def write_splat(path: Path, table: np.ndarray) -> None:
    """Write a .splat file as antimatter15's convert.py does, in the table's order."""
    rows = np.zeros(len(table), [("floats", "<f4", 6), ("bytes", "u1", 8)])
    rows["floats"] = np.concatenate([table[:, :LOG_SCALE], np.exp(table[:, LOG_SCALE:ROTATION])], 1)
    colors = np.concatenate([0.5 + C0 * table[:, COLOR : COLOR + 3], 1 / (1 + np.exp(-table[:, LOGIT:COLOR]))], 1)
    rows["bytes"][:, :4] = np.round(np.clip(colors, 0, 1) * 255)
    rows["bytes"][:, 4:] = np.clip(table[:, ROTATION:LOGIT] * 128 + 128, 0, 255)
    path.write_bytes(rows.tobytes())


def write_sog(path: Path, table: np.ndarray) -> None:
    """Write a .sog archive of version 2 in which each Gaussian has its own entry in the harmonics palette."""
    from imagecodecs import webp_encode

    count, centers = len(table), table[:, :LOG_SCALE].astype(np.float64)
    centers = np.sign(centers) * np.log1p(np.abs(centers))
    low, high = centers.min(0), centers.max(0)
    places = np.round((centers - low) / (high - low) * 65535).astype(np.uint16)
    scales, scale_codes = _coded(table[:, LOG_SCALE:ROTATION])
    colors, color_codes = _coded(table[:, COLOR : COLOR + 3])
    opacities = np.round(255 / (1 + np.exp(-table[:, LOGIT:COLOR])))
    full = np.full((count, 1), 255)
    pictures = {
        "means_l": _square(places & 255, full),
        "means_u": _square(places >> 8, full),
        "quats": _square(_smallest_three(table[:, ROTATION:LOGIT])),
        "scales": _square(scales, full),
        "sh0": _square(colors, opacities),
    }
    meta = {
        "version": 2,
        "count": count,
        "antialias": False,
        "means": {"mins": low.tolist(), "maxs": high.tolist(), "files": ["means_l.webp", "means_u.webp"]},
        "quats": {"files": ["quats.webp"]},
        "scales": {"codebook": scale_codes, "files": ["scales.webp"]},
        "sh0": {"codebook": color_codes, "files": ["sh0.webp"]},
    }
    rest = table[:, COLOR + 3 :].reshape(count, -1, 3)
    if rest.shape[1]:
        coded, codes = _coded(rest)
        palette = np.zeros((-(-count // 64) * 64, rest.shape[1], 3))
        palette[:count] = coded
        numbers = np.arange(count)[:, None]
        pictures["shN_centroids"] = np.insert(palette.reshape(-1, 64 * rest.shape[1], 3), 3, 255, 2)
        pictures["shN_labels"] = _square(numbers & 255, numbers >> 8, numbers * 0, full)
        names, bands = ["shN_centroids.webp", "shN_labels.webp"], {3: 1, 8: 2, 15: 3}[rest.shape[1]]
        meta["shN"] = {"count": count, "bands": bands, "codebook": codes, "files": names}
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("meta.json", json.dumps(meta))
        for name, picture in pictures.items():
            file.writestr(f"{name}.webp", webp_encode(np.ascontiguousarray(picture, np.uint8), lossless=True))


def _coded(values: np.ndarray) -> tuple[np.ndarray, list[float]]:
    low, high = values.min(), values.max()
    codes = np.linspace(low, high, CODES)
    return np.round((values - low) / (high - low) * (CODES - 1)), codes.tolist()


def _smallest_three(rotations: np.ndarray) -> np.ndarray:
    """Three components as bytes, and the index of the largest, which is left out."""
    rotations = rotations / np.linalg.norm(rotations, axis=1, keepdims=True)
    largest = np.abs(rotations).argmax(1)
    rotations = rotations * np.sign(np.take_along_axis(rotations, largest[:, None], 1))
    rest = np.array([np.delete(row, at) for row, at in zip(rotations, largest, strict=True)])
    return np.concatenate([np.round((rest * np.sqrt(2) + 1) / 2 * 255), 252 + largest[:, None]], 1)


def _square(*columns: np.ndarray) -> np.ndarray:
    values = np.concatenate(columns, 1)
    side = int(np.ceil(np.sqrt(len(values)) / 4) * 4)
    picture = np.zeros((side * side, 4))
    picture[: len(values)] = values
    return picture.reshape(side, side, 4)


def require_package(end: str) -> None:
    """Skip the test where the package for this format is not installed."""
    if end.startswith(".usd"):
        pytest.importorskip("pxr")
    elif end in (".compressed.ply", ".spz", ".sog"):
        pytest.importorskip("gsply")


def assert_rejected(path: Path, words: str, read: Callable[[Path], object] = arrays_of) -> None:
    """Assert that reading (by default in this process) fails with these words, the file's path and a hint."""
    with pytest.raises(DataError) as caught:
        read(path)
    assert str(path) in caught.value.sentence and caught.value.hint
    assert re.search(words, caught.value.sentence), caught.value.sentence


def write_sample(folder: Path, end: str, table: np.ndarray | None = None) -> Path:
    """Write a file of these Gaussians, by default 20 of degree 1; skip the test where a package is missing."""
    require_package(end)
    path, table = folder / f"cloud{end}", unit_cloud(20, 1) if table is None else table
    if end == ".sog":
        write_sog(path, table)
    else:
        write_splats(path, SplatFile(table))
    return path
