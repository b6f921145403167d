"""A minimal glTF 2.0 reader: nodes, accessors and buffers, all of them validated."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from scipy.spatial.transform import Rotation

from ...capture.reader_utils import read_bytes
from ...io.inputs import MAX_JSON_BYTES, MOST_BYTES, check_file
from ...io.names import is_file_name
from .checking import damaged

MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", b"JSON", b"BIN\0"
FILE_HEADER, CHUNK_HEADER = struct.Struct("<4sII"), struct.Struct("<I4s")
FLOAT, UNSIGNED_BYTE = 5126, 5121  # component types
COMPONENTS = {5120: "<i1", UNSIGNED_BYTE: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", FLOAT: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
DEEPEST = 100  # levels of nodes
MOST_PLACED = 10_000  # nodes and primitives; a small file can instance one any number of times


class Document:
    """A .glb or .gltf file.

    Args:
        path: The file; a .gltf may refer to files beside it.

    Attributes:
        json: The parsed JSON.
        size: Bytes of the file and of the files read beside it.

    Raises:
        DataError: The file is missing or is not glTF.
        ValueError: The JSON is broken. Methods raise it, KeyError, IndexError and TypeError for damaged files.
    """

    def __init__(self, path: Path) -> None:
        data = read_bytes(path)
        text, self._binary = _chunks(path, data) if data.startswith(MAGIC) else (data, None)
        if len(text) > MAX_JSON_BYTES:
            raise damaged(path, f"its JSON has {len(text):,} bytes, where at most {MAX_JSON_BYTES:,} are read")
        self.path = path
        self.size = len(data)
        self.json = json.loads(text)
        self._buffers: dict[int, bytes] = {}
        self._files: dict[tuple[int, int], bytes] = {}  # by device and inode: many names may refer to one file

    def placed_primitives(self) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
        """Yield each instance of a primitive of the scene with its matrix [4, 4] to the scene."""
        roots = self._roots()
        n_placed = self._checked_number(len(roots))
        waiting = [(number, np.eye(4), 1) for number in roots]
        for number, above, depth in waiting:  # grows while it is iterated
            node = item(self.json["nodes"], number)
            children, matrix = node.get("children", ()), above @ _matrix(node)
            primitives = item(self.json["meshes"], node["mesh"])["primitives"] if "mesh" in node else ()
            n_placed = self._checked_number(n_placed + len(children) + len(primitives))
            if depth == DEEPEST and children:
                raise damaged(self.path, "its nodes are nested without end")
            waiting += [(child, matrix, depth + 1) for child in children]
            yield from ((primitive, matrix) for primitive in primitives)

    def _checked_number(self, n_placed: int) -> int:
        if n_placed > MOST_PLACED:
            raise damaged(self.path, f"it places more than {MOST_PLACED:,} nodes and meshes in its scene")
        return n_placed

    def _roots(self) -> list[int]:
        if "scenes" in self.json:
            return item(self.json["scenes"], self.json.get("scene", 0))["nodes"]
        below = {child for node in self.json["nodes"] for child in node.get("children", ())}
        return [number for number in range(len(self.json["nodes"])) if number not in below]

    def accessor(self, number: int) -> np.ndarray:
        """Return an accessor's values [count, width] float32, normalized integers in [-1, 1]."""
        accessor = item(self.json["accessors"], number)
        if "sparse" in accessor or "bufferView" not in accessor:
            raise ValueError("it has an accessor without a whole buffer view")
        view = item(self.json["bufferViews"], accessor["bufferView"])
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
        strides = (stride, component.itemsize)
        return np.ndarray((count, *kind.shape), component, buffer, offset + start, strides)

    def _buffer(self, number: int) -> bytes:
        if number not in self._buffers:
            uri = item(self.json["buffers"], number).get("uri")
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
        path = self.path.with_name(name)
        check_file(path, MOST_BYTES - self.size)
        file = path.stat().st_dev, path.stat().st_ino
        if file not in self._files:
            self._files[file] = read_bytes(path)
            self.size += len(self._files[file])
        return self._files[file]


def item(values: Any, number: Any) -> dict[str, Any]:
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
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    rotation = Rotation.from_quat(np.array(node.get("rotation", (0, 0, 0, 1)), np.float64).reshape(4))
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.as_matrix() * np.array(node.get("scale", (1, 1, 1)), np.float64)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix
