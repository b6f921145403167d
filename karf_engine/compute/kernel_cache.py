"""Numba's cache on disk, verified by checksum before unpickling."""

from __future__ import annotations

import hashlib
import pickle
import uuid
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache
from numba.core.serialize import dumps

DIGEST_BYTES = 32


class KernelCache(FunctionCache):
    """Cache of one function; read errors count as missing entries, write errors are ignored.

    Raises:
        RuntimeError: Numba finds no folder that can be written.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        source = f"{numba.__version__} {self._impl.locator.get_source_stamp()!r}"
        self._cache_file = CheckedFile(Path(self.cache_path, f"{self._impl.filename_base}.kernel"), source.encode())

    def save_overload(self, sig: Any, data: Any) -> None:
        with suppress(OSError):
            super().save_overload(sig, data)


class CheckedFile:
    """Machine code by signature in one file, which begins with the SHA-256 of the source and the rest of the file.

    Args:
        path: The file.
        source: Identifies source code and compiler; a file with another source counts as missing.
    """

    def __init__(self, path: Path, source: bytes) -> None:
        self._path = path
        self._source = source

    def load(self, key: Any) -> Any:
        """Return the value saved for a key, or None."""
        entry = self._entries().get(key)
        return None if entry is None else pickle.loads(entry)

    def save(self, key: Any, data: Any) -> None:
        """Save a value for a key. Raises OSError if the file cannot be written."""
        body = dumps(self._entries() | {key: dumps(data)})
        temporary = self._path.with_name(f"{self._path.name}.{uuid.uuid4().hex[:16]}")
        try:
            temporary.write_bytes(self._digest(body) + body)
            temporary.replace(self._path)
        finally:
            temporary.unlink(missing_ok=True)

    def _entries(self) -> dict[Any, bytes]:
        try:
            content = self._path.read_bytes()
        except OSError:
            return {}
        digest, body = content[:DIGEST_BYTES], content[DIGEST_BYTES:]
        return pickle.loads(body) if digest == self._digest(body) else {}

    def _digest(self, body: bytes) -> bytes:
        return hashlib.sha256(self._source + body).digest()
