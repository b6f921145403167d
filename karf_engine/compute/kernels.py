"""Compile kernels with numba, and cache them on disk, verified by checksum before unpickling."""

from __future__ import annotations

import hashlib
import os
import pickle
import sys
import uuid
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from ..errors import is_out_of_memory

Kernel = TypeVar("Kernel", bound=Callable[..., Any])
# all fast-math flags except nnan and ninf: training must detect values that are not finite
MATH = {"contract", "reassoc", "nsz", "arcp", "afn"}
DIGEST_BYTES = 32


def has_kernels() -> bool:
    """Test whether numba can be imported and the environment does not set KARF_KERNELS=off."""
    if os.environ.get("KARF_KERNELS", "on") == "off":
        return False
    try:
        import numba  # noqa: F401
    except (ImportError, OSError) as error:  # missing, or built for another numpy or CPU
        if is_out_of_memory(error):
            raise
        return False
    return True


def cache_folder() -> Path:
    """Return the cache folder in the user's account; the package may be read-only."""
    if "NUMBA_CACHE_DIR" in os.environ:
        return Path(os.environ["NUMBA_CACHE_DIR"])
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "karf" / "kernels"


def kernel(function: Kernel) -> Kernel:
    """Compile a function on first call and cache it on disk; it must not allocate arrays.

    Without allocation numba needs no reference counting, which costs as much as a small function.
    """
    return _compile(function, MATH, False)


def allocating_kernel(function: Kernel) -> Kernel:
    """Compile a function that may allocate arrays."""
    return _compile(function, MATH, True)


def literal_kernel(function: Kernel) -> Kernel:
    """Compile a function without fast-math, so that equal sums have equal bits."""
    return _compile(function, False, False)


def _compile(function: Kernel, math: set[str] | bool, makes_arrays: bool) -> Kernel:
    import numba
    from numba.core import config

    config.CACHE_DIR = str(cache_folder())  # pyright: ignore[reportAttributeAccessIssue]
    options: dict[str, Any] = {"fastmath": math, "error_model": "numpy", "nogil": True, "_nrt": makes_arrays}
    compiled: Any = numba.njit(function, **options)
    # without a writable folder with a UTF-8 name, or with an unknown numba, each process compiles for itself
    with suppress(RuntimeError, ImportError, AttributeError, TypeError, UnicodeError):
        compiled._cache = _disk_cache(function)
    return compiled


def _disk_cache(function: Callable[..., Any]) -> Any:
    """Return numba's cache of a function on disk; read errors count as missing entries, write errors are ignored."""
    import numba
    from numba.core.caching import FunctionCache

    class KernelCache(FunctionCache):
        def save_overload(self, sig: Any, data: Any) -> None:
            with suppress(OSError):
                super().save_overload(sig, data)

    cache: Any = KernelCache(function)
    source = f"{numba.__version__} {cache._impl.locator.get_source_stamp()!r}"
    cache._cache_file = _CheckedFile(Path(cache.cache_path, f"{cache._impl.filename_base}.kernel"), source.encode())
    return cache


class _CheckedFile:
    """Machine code by signature in a file, after the SHA-256 of `source` (code and compiler) and the rest of the file."""

    def __init__(self, path: Path, source: bytes) -> None:
        self._path = path
        self._source = source

    def load(self, key: Any) -> Any:
        """Return the value saved for a key, or None."""
        entry = self._entries().get(key)
        return None if entry is None else pickle.loads(entry)

    def save(self, key: Any, data: Any) -> None:
        """Save a value for a key. Raises OSError if the file cannot be written."""
        from numba.core.serialize import dumps

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
