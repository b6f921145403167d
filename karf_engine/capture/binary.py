"""Sequential reader of little-endian binary files, with bounds checks before memory is allocated."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import DataError
from .reader_utils import read_bytes


class BinaryFile:
    """The content of a file and a read position. Reading beyond the end raises DataError; `what` names the entry.

    Attributes:
        path: The file.
        data: Its bytes.
        position: Offset of the next byte.
    """

    def __init__(self, path: Path, hint: str) -> None:
        self.path, self.data, self.position = path, read_bytes(path), 0
        self._hint = hint

    def entries(self, what: str) -> Iterator[str]:
        """Read the number of entries and yield a label for each; raises DataError if bytes are left at the end."""
        (count,) = self.values("Q", f"the number of {what}s")
        for number in range(count):
            yield f"{what} {number + 1} of {count}"
        if self.position != len(self.data):
            n_left = len(self.data) - self.position
            raise DataError(f"{self.path} has {n_left} bytes after its last {what}.", self._hint)

    def skip(self, size: int, what: str) -> int:
        """Advance by `size` bytes and return the old position."""
        start, self.position = self.position, self.position + size
        if self.position > len(self.data):
            raise DataError(f"{self.path} is cut off at byte {len(self.data)}, within {what}.", self._hint)
        return start

    def values(self, layout: str, what: str) -> tuple:
        """Read values of a `struct` layout."""
        return struct.unpack_from("<" + layout, self.data, self.skip(struct.calcsize("<" + layout), what))

    def table(self, dtype: np.dtype, count: int, what: str) -> np.ndarray:
        """Read `count` records as a view of the file's bytes."""
        return np.frombuffer(self.data, dtype, count, self.skip(dtype.itemsize * count, what))

    def text(self, what: str) -> str:
        """Read a zero-terminated UTF-8 string."""
        end = self.data.find(b"\0", self.position)
        start = self.skip((end if end >= 0 else len(self.data)) + 1 - self.position, what)
        try:
            return self.data[start : self.position - 1].decode("utf-8")
        except UnicodeDecodeError as error:
            raise DataError(f"{self.path} has a name that is not UTF-8 text in {what}.", self._hint) from error
