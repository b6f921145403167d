"""Write arrays of answers to files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...io.files import errors_naming_path


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Write arrays as raw float32 in native byte order, one after the other.

    Returns:
        `pixels`, the file; `arrays`, the `shape`, `dtype` and `offset` in bytes of each.
    """
    placed, offset = {}, 0
    with errors_naming_path(path), path.open("wb") as stream:
        for name, array in arrays.items():
            pixels = np.ascontiguousarray(array, np.float32)
            stream.write(pixels.data)
            placed[name] = {"shape": list(pixels.shape), "dtype": "float32", "offset": offset}
            offset += pixels.nbytes
    return {"pixels": str(path), "arrays": placed}
