"""Compiled kernels: whether numba is there, how they are compiled, and where their machine code is kept."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from ..errors import is_out_of_memory

Kernel = TypeVar("Kernel", bound=Callable[..., Any])
# all liberties but those that let NaN and infinity vanish: training must see them and stop
MATH = {"contract", "reassoc", "nsz", "arcp", "afn"}


def has_kernels() -> bool:
    """Whether numba is there and loads, and is not left out by the variable KARF_KERNELS=off.

    Raises:
        Exception: It is there, and memory does not suffice to load it.
    """
    if os.environ.get("KARF_KERNELS", "on") == "off":
        return False
    try:
        import numba  # noqa: F401
    except (ImportError, OSError) as error:  # not there, or not made for this numpy or processor
        if is_out_of_memory(error):
            raise
        return False
    return True


def cache_folder() -> Path:
    """Where compiled kernels are kept: the user's own cache, for the package may lie where nothing can be written."""
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
    """A function of numbers and arrays, compiled when it is first called and kept for other processes.

    It makes no arrays, so that none are counted: counting costs as much as a small function does.
    """
    return _compiled(function, MATH, False)


def allocating_kernel(function: Kernel) -> Kernel:
    """A kernel that makes arrays to work in."""
    return _compiled(function, MATH, True)


def literal_kernel(function: Kernel) -> Kernel:
    """A kernel whose operations are rounded one by one, as they are written: two forms of one sum give the same bits."""
    return _compiled(function, False, False)


def _compiled(function: Kernel, math: set[str] | bool, makes_arrays: bool) -> Kernel:
    import numba

    numba.config.CACHE_DIR = str(cache_folder())
    compiled = numba.njit(function, fastmath=math, error_model="numpy", nogil=True, _nrt=makes_arrays)
    # no folder that could be written, one whose name is not UTF-8, or another numba within: each process compiles for itself
    with suppress(RuntimeError, ImportError, AttributeError, TypeError, UnicodeError):
        from .kernel_cache import KernelCache

        compiled._cache = KernelCache(function)
    return compiled
