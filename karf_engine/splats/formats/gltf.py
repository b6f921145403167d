"""Gaussians in glTF files (.glb, .gltf): points with Khronos' extension KHR_gaussian_splatting.

Format: glTF 2.0 and the extension's page in KhronosGroup/glTF: centers; unit quaternions x y z w; scales, not
logarithms; opacities; red green blue per harmonic, in the order and signs of Kerbl et al. Colors are display-referred
sRGB (`srgb_rec709_display`). Linear colors are refused: their harmonics cannot be converted.

glTF is y up. The table is written as in PLY, below a node that rotates it by 180 degrees about x (see `UPRIGHT`), which
loses no precision. Transforms of nodes are applied when reading.

Precision: float32. Centers and harmonics are exact; opacity 2e-7, log scales 1e-5, unit quaternions 1e-6.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import numpy as np

from ...capture.reader_utils import read_bytes
from ...errors import DataError
from ...io.files import atomic_write
from ...io.names import file_name, is_file_name
from ...version import __version__
from ..gaussians import DEGREES
from ..kernels.arrays import C0, COLOR, LOG_SCALE, LOGIT, ROTATION
from ..similarity import transform_table
from .splat_file import UPRIGHT, SplatFile, damaged, explaining, log_scales, logits, opacities, unit_rotations, usable

EXTENSION = "KHR_gaussian_splatting"
KERNEL, SRGB = "ellipse", "srgb_rec709_display"
MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", b"JSON", b"BIN\0"
FILE_HEADER, CHUNK_HEADER = struct.Struct("<4sII"), struct.Struct("<I4s")
FLOAT, UNSIGNED_BYTE = 5126, 5121  # component types
COMPONENTS = {5120: "<i1", UNSIGNED_BYTE: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", FLOAT: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
POINTS, VERTICES = 0, 34962  # mode POINTS, target ARRAY_BUFFER
MOST_NODES = 10_000  # a small file can instance one any number of times, or without end
MARK = 16  # characters of the checksum in the name of a .bin
HALF_TURN = [1.0, 0.0, 0.0, 0.0]  # quaternion x y z w


def read(path: Path) -> SplatFile:
    """Read all Gaussians of a glTF file's scene, transformed by its nodes, in the axes of PLY."""
    with explaining(path):
        document = _Document(path)
        tables = [
            transform_table(_table(document, primitive), UPRIGHT @ matrix)
            for primitive, matrix in document.placed_primitives()
            if EXTENSION in primitive.get("extensions", {})
        ]
        if not tables:
            raise damaged(path, f"it has no points with {EXTENSION}")
        return usable(path, np.concatenate(tables))


def write(path: Path, splats: SplatFile) -> None:
    """Write Gaussians as .glb, or as .gltf with a .bin beside it; columns are dropped.

    The .bin is named after the .gltf and a checksum, so that an existing pair stays valid until the new one is complete.
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
class _Document:
    """A .glb or .gltf file. Methods raise ValueError, KeyError, IndexError and TypeError for damaged files."""

    def __init__(self, path: Path) -> None:
        data = read_bytes(path)
        text, self._binary = _chunks(path, data) if data.startswith(MAGIC) else (data, None)
        self.path, self.json = path, json.loads(text)
        self._buffers: dict[int, bytes] = {}

    def placed_primitives(self) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
        """Yield each instance of a primitive of the scene with its matrix [4, 4] to the scene."""
        waiting = [(number, np.eye(4)) for number in self._roots()]
        for number, above in waiting:  # grows while it is iterated
            if len(waiting) > MOST_NODES:
                raise damaged(self.path, f"it places more than {MOST_NODES:,} nodes in its scene")
            node = _item(self.json["nodes"], number)
            matrix = above @ _matrix(node)
            waiting += [(child, matrix) for child in node.get("children", ())]
            if "mesh" in node:
                for primitive in _item(self.json["meshes"], node["mesh"])["primitives"]:
                    yield primitive, matrix

    def _roots(self) -> list[int]:
        if "scenes" in self.json:
            return _item(self.json["scenes"], self.json.get("scene", 0))["nodes"]
        below = {child for node in self.json["nodes"] for child in node.get("children", ())}
        return [number for number in range(len(self.json["nodes"])) if number not in below]

    def accessor(self, number: int) -> np.ndarray:
        """Return an accessor's values [count, width] float32, normalized integers in [-1, 1]."""
        accessor = _item(self.json["accessors"], number)
        if "sparse" in accessor or "bufferView" not in accessor:
            raise ValueError("it has an accessor without a whole buffer view")
        view = _item(self.json["bufferViews"], accessor["bufferView"])
        kind = np.dtype((COMPONENTS[accessor["componentType"]], WIDTHS[accessor["type"]]))
        stored = self._strided(view, _whole(accessor.get("byteOffset", 0)), _whole(accessor["count"]), kind)
        values = stored.astype(np.float32)
        if accessor.get("normalized"):
            values = np.maximum(values / np.iinfo(stored.dtype).max, -1)
        return values

    def _strided(self, view: dict[str, Any], start: int, count: int, kind: np.dtype) -> np.ndarray:
        """Return values [count, width] of a buffer view, without copying."""
        buffer = self._buffer(_whole(view["buffer"]))
        offset, length = _whole(view.get("byteOffset", 0)), _whole(view["byteLength"])
        stride = _whole(view.get("byteStride", kind.itemsize))
        end = start + stride * (count - 1) + kind.itemsize
        if offset + length > len(buffer) or count < 1 or end > length or stride < kind.itemsize:
            raise ValueError("it has an accessor outside its buffer")
        component = kind.base
        return np.ndarray((count, *kind.shape), component, buffer, offset + start, (stride, component.itemsize))

    def _buffer(self, number: int) -> bytes:
        if number not in self._buffers:
            uri = _item(self.json["buffers"], number).get("uri")
            self._buffers[number] = self._binary if uri is None and number == 0 and self._binary else self._fetched(uri)
        return self._buffers[number]

    def _fetched(self, uri: Any) -> bytes:
        """Return the bytes of a URI (RFC 3986): a data URI, or a file in the same folder."""
        if not isinstance(uri, str):
            raise ValueError("it has a buffer without bytes")
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(";base64,")[2], validate=True)
        name = unquote(uri)
        if not is_file_name(name):
            raise damaged(self.path, f"it wants {uri[:100]!r}, which is no file beside it")
        return read_bytes(self.path.with_name(name))


def _item(values: Any, number: Any) -> dict[str, Any]:
    """Return the object at an index of a list."""
    found = values[_whole(number)]
    if not isinstance(found, dict):
        raise TypeError("it has something else where an object is wanted")
    return found


def _whole(value: Any) -> int:
    if type(value) is not int or value < 0:
        raise ValueError(f"{str(value)[:40]!r} is no whole number of 0 or more")
    return value


def _chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    """Return the JSON and the binary chunk of a .glb file."""
    _, version, _ = FILE_HEADER.unpack_from(data)
    if version != 2:
        raise damaged(path, f"it is glTF of version {version}; 2 is read")
    found, start = {}, FILE_HEADER.size
    while start < len(data) and len(found) < 2:
        length, kind = CHUNK_HEADER.unpack_from(data, start)
        start += CHUNK_HEADER.size
        if start + length > len(data):
            raise damaged(path, "it is cut off")
        found.setdefault(kind, data[start : start + length])
        start += length
    return found[JSON_CHUNK], found.get(BINARY_CHUNK)


def _matrix(node: dict[str, Any]) -> np.ndarray:
    """Return the matrix [4, 4] from a node to its parent."""
    from scipy.spatial.transform import Rotation  # slow to import

    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    rotation = Rotation.from_quat(np.array(node.get("rotation", (0, 0, 0, 1)), np.float64).reshape(4))
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.as_matrix() * np.array(node.get("scale", (1, 1, 1)), np.float64)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def _table(document: _Document, primitive: dict[str, Any]) -> np.ndarray:
    """Return the table [n, 11 + 3 K] float32 of a primitive."""
    splatting, attributes = primitive["extensions"][EXTENSION], primitive["attributes"]
    for name, known in (("kernel", KERNEL), ("colorSpace", SRGB)):
        if splatting[name] != known:
            raise DataError(
                "{path} has Gaussians whose {name} is {value!r}; {known!r} is read.",
                "Export them so, or as .ply.",
                path=document.path,
                name=name,
                value=splatting[name],
                known=known,
            )
    if splatting.get("extensions"):
        raise DataError(
            "{path} has packed Gaussians ({names}).",
            "Export them without compression, or as .spz or .ply.",
            path=document.path,
            names=", ".join(splatting["extensions"]),
        )
    n_harmonics = max((count for count in DEGREES if _harmonic_names(count)[-1] in attributes), default=1)
    arrays = (document.accessor(attributes[name]) for name in _names(n_harmonics))
    centers, rotations, scales, alphas, *harmonics = arrays
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
    scales = np.exp(table[:, LOG_SCALE:ROTATION].astype(np.float64))
    alphas, harmonics = opacities(table[:, LOGIT:COLOR]), table[:, COLOR:].reshape(len(table), -1, 3)
    arrays = (table[:, :LOG_SCALE], np.roll(unit_rotations(table), -1, 1), scales, alphas, *harmonics.swapaxes(0, 1))
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
