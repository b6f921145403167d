"""The processor's cores: torch has them, or threads of Python share them out.

Torch's own threads wait for one another spinning, on cores that others could use, and where an operation is over in a
millisecond they bring nothing. So once compiled kernels work on a field, torch computes on one core, and larger pieces
of work are shared out. What they call lets go of Python's lock while it computes.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

import torch

PARTS = 4  # parts of the work for each thread: they take different times


class _Cores:
    """How many this process uses, and whether they are shared out; torch's default until `use` was called."""

    count: int = 0
    are_shared = False


class _Thread(threading.local):
    """Whether this thread is one of those that share the cores: it shares out nothing itself."""

    is_sharing = False


_thread = _Thread()


def use(count: int) -> None:
    """Use this many cores from now on, for torch."""
    _Cores.count, _Cores.are_shared = count, False
    torch.set_num_threads(count)


def count() -> int:
    """How many cores this process uses."""
    return _Cores.count or torch.get_num_threads()


def take_from_torch() -> None:
    """Leave torch one core from now on, until the next `use`, and share out the work."""
    _Cores.count, _Cores.are_shared = count(), True
    torch.set_num_threads(1)


def share(function: Callable[..., None], n: int, *arguments: Any) -> None:
    """Call `function(first, last, *arguments)` for parts of `range(n)`, on all cores where torch does not have them.

    The parts must not depend on each other, nor track gradients.

    Example:
        >>> squares = [0] * 5
        >>> def fill(first, last, out):
        ...     out[first:last] = [number**2 for number in range(first, last)]
        >>> share(fill, 5, squares)
        >>> squares
        [0, 1, 4, 9, 16]
    """
    threads = count() if _Cores.are_shared and not _thread.is_sharing else 1
    if threads == 1 or n <= 1:
        with torch.no_grad():
            function(0, n, *arguments)
        return
    n_parts = min(n, PARTS * threads)
    cuts = [n * part // n_parts for part in range(n_parts + 1)]
    for future in [
        _pool(threads).submit(function, first, last, *arguments) for first, last in itertools.pairwise(cuts)
    ]:
        future.result()


@lru_cache(maxsize=1)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="karf-core", initializer=_begin)


def _begin() -> None:
    """What is kept for each thread, as `runtime.start_runtime` has it for the first."""
    _thread.is_sharing = True
    torch.set_num_threads(1)
    torch.set_grad_enabled(False)
    torch.set_flush_denormal(True)
