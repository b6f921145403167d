"""Read and write volumes.json: boxes and meshes that an artist places to bound objects.

    {"schema": "karf-volumes/1", "objects": {"pot": [{"kind": "inside", "matrix": [[..4..]..4..]}, ..]}}

A box is the cube [-1, 1]^3 transformed by its matrix to the capture's world. A mesh has `vertices` [n, 3] in that world
and `triangles` [m, 3] of vertex indices; its convex hull counts. An object is inside all of its volumes of the kind
`inside`, and outside all of the kind `outside`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DataError
from ..io.files import read_json, write_json

SCHEMA = "karf-volumes/1"
KINDS = ("inside", "outside")
MAX_VERTICES = 1_000_000
HINT = "Write it again; see docs/files.md."


@dataclass(frozen=True)
class Volume:
    """A box or a mesh."""

    kind: str  # `inside` or `outside`
    matrix: np.ndarray | None = None  # [4, 4], from the cube [-1, 1]^3 to the capture's world; None for a mesh
    vertices: np.ndarray | None = None  # [n, 3] in the capture's world; None for a box
    triangles: np.ndarray | None = None  # [m, 3] int, of a mesh


def write_volumes(path: Path, objects: Mapping[str, Sequence[Volume]]) -> None:
    """Write the volumes of objects, by name, atomically."""
    write_json(path, {"schema": SCHEMA, "objects": {name: [_to_json(v) for v in own] for name, own in objects.items()}})


def read_volumes(path: Path) -> dict[str, list[Volume]]:
    """Read the volumes of each object; a missing file has none. Raises DataError if the file or a volume is damaged."""
    if not path.exists():
        return {}
    content = read_json(path, "volumes")
    if not isinstance(content, dict) or content.get("schema") != SCHEMA or not isinstance(content.get("objects"), dict):
        raise DataError(f"{path} holds no volumes of the schema {SCHEMA}.", HINT)
    try:
        return {str(name): [_from_json(entry) for entry in own] for name, own in content["objects"].items()}
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
        raise DataError(f"{path} holds what is no volume ({error!r:.200}).", HINT) from error


def _to_json(volume: Volume) -> dict[str, Any]:
    arrays = {"matrix": volume.matrix, "vertices": volume.vertices, "triangles": volume.triangles}
    return {"kind": volume.kind, **{name: np.asarray(a).tolist() for name, a in arrays.items() if a is not None}}


def _from_json(entry: dict[str, Any]) -> Volume:
    if entry["kind"] not in KINDS:
        raise ValueError(f"the kind {entry['kind']!r}")
    if "matrix" in entry:
        matrix = np.array(entry["matrix"], np.float64).reshape(4, 4)
        if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix[:3, :3])) < 1e-30:
            raise ValueError("a matrix that makes no box")
        return Volume(entry["kind"], matrix)
    vertices = np.array(entry["vertices"], np.float64).reshape(-1, 3)
    if not np.isfinite(vertices).all() or not 4 <= len(vertices) <= MAX_VERTICES:
        raise ValueError(f"{len(vertices)} vertices, or one that is not finite")
    triangles = np.array(entry.get("triangles", []), np.int64).reshape(-1, 3)
    return Volume(entry["kind"], None, vertices, triangles)
