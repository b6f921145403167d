"""Gaussians in glTF files (.glb, .gltf): points with Khronos' extension KHR_gaussian_splatting.

Format: glTF 2.0 and the extension's page in KhronosGroup/glTF: centers; unit quaternions x y z w; scales, not
logarithms; opacities; red green blue per harmonic, in the order and signs of Kerbl et al. Colors are display-referred
sRGB (`srgb_rec709_display`). Linear colors are refused: their harmonics cannot be converted.

glTF is y up. The table is written as in PLY, below a node that rotates it by 180 degrees about x (see `turning`), which
loses no precision. Transforms of nodes are applied when reading.

Precision: float32. Centers and harmonics are exact; opacity 2e-7, log scales 1e-5, unit quaternions 1e-6.
"""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from ...errors import DataError
from ...io.files import atomic_write
from ...io.names import file_name
from ...version import __version__
from ..gaussians import DEGREES
from ..kernels.arrays import C0, COLOR, LOG_SCALE, LOGIT, ROTATION
from ..similarity import transform_table
from .checking import check_count, checked, damaged, explaining, log_scales, logits, opacities
from .gltf_document import (
    BINARY_CHUNK,
    CHUNK_HEADER,
    FILE_HEADER,
    FLOAT,
    JSON_CHUNK,
    MAGIC,
    UNSIGNED_BYTE,
    WIDTHS,
    Document,
)
from .splat_file import SplatFile
from .turning import UPRIGHT

EXTENSION = "KHR_gaussian_splatting"
KERNEL, SRGB = "ellipse", "srgb_rec709_display"
POINTS, VERTICES = 0, 34962  # mode POINTS, target ARRAY_BUFFER
MARK = 16  # characters of the checksum in the name of a .bin
HALF_TURN = [1.0, 0.0, 0.0, 0.0]  # quaternion x y z w


def read(path: Path) -> SplatFile:
    """Read all Gaussians of a glTF file's scene, transformed by its nodes, in the axes of PLY.

    Raises:
        DataError: The file, or one that it refers to, is missing, damaged or outside its folder, there are no Gaussians,
            their kernel or color space is not supported, or a row is not a Gaussian.
    """
    with explaining(path):
        document = Document(path)
        placed = [pair for pair in document.placed_primitives() if EXTENSION in pair[0].get("extensions", {})]
        if not placed:
            raise damaged(path, f"it has no points with {EXTENSION}")
        tables, count = [], 0
        for primitive, matrix in placed:
            table = _table(document, primitive, count)
            count += len(table)
            tables.append(transform_table(table, UPRIGHT @ matrix))
        return SplatFile(checked(path, np.concatenate(tables)))


def write(path: Path, splats: SplatFile) -> None:
    """Write Gaussians as .glb, or as .gltf with a .bin beside it; columns are dropped.

    The .bin is named after the .gltf and a checksum, so that an existing pair stays valid until the new one is complete.

    Raises:
        OSError: The disk takes no more, or the folder cannot be written.
    """
    attributes = _attributes(splats.table)
    binary = b"".join(values.tobytes() for values in attributes.values())
    buffer: dict[str, Any] = {"byteLength": len(binary)}
    if path.suffix.lower() == ".gltf":
        numbers = path.with_name(f"{file_name(path.stem)}.{hashlib.sha256(binary).hexdigest()[:MARK]}.bin")
        atomic_write(numbers, lambda temporary: temporary.write_bytes(binary))
        content = json.dumps(_json(attributes, buffer | {"uri": quote(numbers.name)}), indent=1).encode()
        atomic_write(path, lambda temporary: temporary.write_bytes(content))
        _remove_earlier(numbers)
    else:
        text = json.dumps(_json(attributes, buffer), separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        content = CHUNK_HEADER.pack(len(text), JSON_CHUNK) + text
        content += CHUNK_HEADER.pack(len(binary), BINARY_CHUNK) + binary
        content = FILE_HEADER.pack(MAGIC, 2, FILE_HEADER.size + len(content)) + content
        atomic_write(path, lambda temporary: temporary.write_bytes(content))


def _remove_earlier(numbers: Path) -> None:
    """Remove the .bin files of earlier versions of the same .gltf."""
    stem = numbers.name[: -len(".bin") - MARK]
    earlier = re.compile(re.escape(stem) + rf"[0-9a-f]{{{MARK}}}\.bin")
    for path in numbers.parent.iterdir():
        if earlier.fullmatch(path.name) and path.name != numbers.name:
            path.unlink(missing_ok=True)


# --------------------------------------------------------------------------------------------------------------- reading
def _table(document: Document, primitive: dict[str, Any], n_before: int) -> np.ndarray:
    """Return the table [n, 11 + 3 K] float32 of a primitive. n_before: number of Gaussians read before it."""
    splatting, attributes = primitive["extensions"][EXTENSION], primitive["attributes"]
    if splatting["kernel"] != KERNEL or splatting["colorSpace"] != SRGB or splatting.get("extensions"):
        raise DataError(
            f"{document.path} has Gaussians of another kernel than {KERNEL}, in other colors than {SRGB}, or packed.",
            f"Export them as plain {EXTENSION}, in sRGB.",
        )
    n_harmonics = max((count for count in DEGREES if _harmonic_names(count)[-1] in attributes), default=1)
    first, *names = _names(n_harmonics)
    centers = document.accessor(attributes[first])
    check_count(document.path, n_before + len(centers), n_harmonics, document.size)
    rotations, scales, alphas, *harmonics = (document.accessor(attributes[name]) for name in names)
    parts = (centers, log_scales(scales), np.roll(rotations, 1, 1), logits(alphas), *harmonics)
    if [part.shape[1] for part in parts] != [3, 3, 4, 1, *[3] * n_harmonics]:
        raise damaged(document.path, "its attributes have other widths than Gaussians")
    return np.concatenate(parts, 1, dtype=np.float32)


def _names(n_harmonics: int) -> list[str]:
    return ["POSITION", *(f"{EXTENSION}:{name}" for name in ("ROTATION", "SCALE", "OPACITY")),
            *_harmonic_names(n_harmonics)]  # fmt: skip


def _harmonic_names(count: int) -> list[str]:
    degrees = range(DEGREES[count] + 1)
    return [f"{EXTENSION}:SH_DEGREE_{degree}_COEF_{number}" for degree in degrees for number in range(2 * degree + 1)]


# --------------------------------------------------------------------------------------------------------------- writing
def _attributes(table: np.ndarray) -> dict[str, np.ndarray]:
    """Return arrays by attribute name, with point colors for programs that do not know Gaussians."""
    rotations = table[:, ROTATION:LOGIT].astype(np.float64)
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    scales = np.exp(table[:, LOG_SCALE:ROTATION].astype(np.float64))
    alphas, harmonics = opacities(table[:, LOGIT:COLOR]), table[:, COLOR:].reshape(len(table), -1, 3)
    arrays = (table[:, :LOG_SCALE], np.roll(rotations, -1, 1), scales, alphas, *harmonics.swapaxes(0, 1))
    found = {
        name: np.ascontiguousarray(values, "<f4")
        for name, values in zip(_names(harmonics.shape[1]), arrays, strict=True)
    }
    colors = np.concatenate([0.5 + C0 * harmonics[:, 0], alphas], 1)
    return found | {"COLOR_0": np.round(np.clip(colors, 0, 1) * 255).astype(np.uint8)}


def _json(attributes: dict[str, np.ndarray], buffer: dict[str, Any]) -> dict[str, Any]:
    splatting = {"kernel": KERNEL, "colorSpace": SRGB, "sortingMethod": "cameraDistance", "projection": "perspective"}
    primitive = {
        "attributes": {name: number for number, name in enumerate(attributes)},
        "mode": POINTS,
        "extensions": {EXTENSION: splatting},
    }
    views, start = [], 0
    for values in attributes.values():
        views.append({"buffer": 0, "byteOffset": start, "byteLength": values.nbytes, "target": VERTICES})
        start += values.nbytes
    return {
        "asset": {"version": "2.0", "generator": f"KaRF {__version__}"},
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "rotation": HALF_TURN}],
        "meshes": [{"primitives": [primitive]}],
        "buffers": [buffer],
        "bufferViews": views,
        "accessors": [_accessor(number, values) for number, values in enumerate(attributes.values())],
    }


def _accessor(number: int, values: np.ndarray) -> dict[str, Any]:
    """Return the accessor of an array, with the bounds that glTF requires for positions."""
    kind = next(name for name, width in WIDTHS.items() if width == values.shape[1])
    accessor = {"bufferView": number, "count": len(values), "type": kind,
                "min": values.min(0).tolist(), "max": values.max(0).tolist()}  # fmt: skip
    if values.dtype == np.uint8:
        return accessor | {"componentType": UNSIGNED_BYTE, "normalized": True}
    return accessor | {"componentType": FLOAT}
