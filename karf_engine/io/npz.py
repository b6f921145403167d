"""Read arrays of npz files without pickle, checking sizes before memory is allocated."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import DataError
from .failures import is_out_of_memory
from .files import check_file

# limits of decompression bombs
MOST_OF_SMALL = 512 << 20  # bytes
MOST_PER_BYTE = 200


def read_arrays(path: Path, names: Sequence[str], what: str, hint: str) -> list[np.ndarray]:
    """Read arrays of an npz file, in the order of the names; `what` and `hint` are content and remedy, for messages.

    Raises DataError if the file is missing or damaged, lacks an array, or claims too many bytes.
    """
    label = f"{path} ({what})"
    most = max(MOST_OF_SMALL, MOST_PER_BYTE * check_file(path, label=label))
    try:
        with zipfile.ZipFile(path) as archive:
            members = [archive.getinfo(f"{name}.npy") for name in names]
            claimed = sum(member.file_size for member in members)
            if claimed > most:
                raise ValueError(f"it claims {claimed:,} bytes of arrays; at most {most:,} are read of its length")
            return [_read_array(archive, member) for member in members]
    except Exception as error:  # damaged archives raise nearly anything
        if is_out_of_memory(error):
            raise
        raise DataError(
            "{path} cannot be read: {reason}.", hint, path=label, reason=str(error) or type(error).__name__
        ) from error


def has_arrays(path: Path, names: Sequence[str]) -> bool:
    """Test whether an intact npz file has all of these arrays."""
    with zipfile.ZipFile(path) as archive:
        return {f"{name}.npy" for name in names} <= set(archive.namelist())


def _read_array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> np.ndarray:
    """Read one array without objects, checking its header against the length of its member."""
    with archive.open(member) as stream:
        version = np.lib.format.read_magic(stream)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read_header(stream)
        if dtype.hasobject or math.prod(shape) * dtype.itemsize != member.file_size - stream.tell():
            raise ValueError(f"{member.filename} is not an array of {shape} {dtype}")
    with archive.open(member) as stream:
        return np.lib.format.read_array(stream, allow_pickle=False)
