"""Little-endian binary files, read front to back, whose lengths are checked before memory is allocated."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import DataError
from .reading import read_bytes


class BinaryFile:
    """The content of a file with a position in it; reading beyond its end raises DataError.

    Attributes:
        path: The file.
        data: Its bytes.
        at: The position.
    """

    def __init__(self, path: Path, hint: str) -> None:
        """Read a file whole; hint: what the user can do where it is damaged. Raises DataError as `read_bytes`."""
        self.path, self.data, self.at = path, read_bytes(path), 0
        self._hint = hint

    def entries(self, what: str) -> Iterator[str]:
        """A label for each entry that the file's head announces; at the end no bytes may be left."""
        (count,) = self.values("Q", f"the number of {what}s")
        for number in range(count):
            yield f"{what} {number + 1} of {count}"
        if self.at != len(self.data):
            raise DataError(f"{self.path} has {len(self.data) - self.at} bytes after its last {what}.", self._hint)

    def take(self, size: int, what: str) -> int:
        """Where the next `size` bytes begin; they are passed. what: they are part of, for messages."""
        start, self.at = self.at, self.at + size
        if self.at > len(self.data):
            raise self.cut_off(what)
        return start

    def cut_off(self, what: str) -> DataError:
        """The error for a file that ends within `what`."""
        return DataError(f"{self.path} is cut off at byte {len(self.data)}, within {what}.", self._hint)

    def values(self, layout: str, what: str) -> tuple:
        """The next values, of a layout as in `struct`."""
        return struct.unpack_from("<" + layout, self.data, self.take(struct.calcsize("<" + layout), what))

    def table(self, dtype: np.dtype, count: int, what: str) -> np.ndarray:
        """The next `count` records, as a view of the file's bytes."""
        return np.frombuffer(self.data, dtype, count, self.take(dtype.itemsize * count, what))

    def text(self, what: str) -> str:
        """The next text, which is UTF-8 and ends with a zero byte."""
        end = self.data.find(b"\0", self.at)
        start = self.take((end if end >= 0 else len(self.data)) + 1 - self.at, what)
        try:
            return self.data[start : self.at - 1].decode("utf-8")
        except UnicodeDecodeError as error:
            raise DataError(f"{self.path} has a name that is not UTF-8 text in {what}.", self._hint) from error
