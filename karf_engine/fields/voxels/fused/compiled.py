"""How the kernels are compiled, where their machine code is kept, and how they share the processor's cores."""

from __future__ import annotations

import itertools
import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numba
import torch

Kernel = TypeVar("Kernel", bound=Callable[..., Any])
# all liberties but those that let NaN and infinity vanish: training must see them and stop
MATH = {"contract", "reassoc", "nsz", "arcp", "afn"}
PARTS = 4  # of the work a thread: parts take different times


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
    """A function of numbers and arrays, compiled when it is first called and kept for other processes."""
    numba.config.CACHE_DIR = str(cache_folder())
    return numba.njit(function, fastmath=MATH, error_model="numpy", nogil=True, cache=True)


def share(compiled: Callable[..., None], count: int, *arguments: Any) -> None:
    """Call `compiled(first, last, *arguments)` for parts of `range(count)`, on as many threads as torch has.

    The parts must not depend on each other. Kernels release Python's lock while they compute.
    """
    threads = torch.get_num_threads()
    if threads == 1 or count <= 1:
        compiled(0, count, *arguments)
        return
    n_parts = min(count, PARTS * threads)
    cuts = [count * part // n_parts for part in range(n_parts + 1)]
    for future in [
        _pool(threads).submit(compiled, first, last, *arguments) for first, last in itertools.pairwise(cuts)
    ]:
        future.result()


@lru_cache(maxsize=1)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="karf-kernel")
