"""Compile kernels with numba, and locate their cache."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from ..errors import is_out_of_memory

Kernel = TypeVar("Kernel", bound=Callable[..., Any])
# all fast-math flags except nnan and ninf: training must detect values that are not finite
MATH = {"contract", "reassoc", "nsz", "arcp", "afn"}


def has_kernels() -> bool:
    """Test whether numba can be imported and the environment does not set KARF_KERNELS=off.

    Raises:
        Exception: Memory ran out while numba was loaded.
    """
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
        from .kernel_cache import KernelCache

        compiled._cache = KernelCache(function)
    return compiled
