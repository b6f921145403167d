"""Use the CPU cores either by torch or by a pool of Python threads.

Torch's threads spin while they wait and gain nothing for operations of a millisecond. So with compiled kernels, torch
computes on one core and larger pieces of work, which release the GIL, run in the pool.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

import torch

PARTS = 4  # parts of the work per thread, to balance the load


class _Cores:
    count: int = 0  # 0: torch's default
    has_pool = False


_thread = threading.local()  # its `is_worker` is set in threads of the pool


def set_core_count(count: int) -> None:
    """Give torch this many cores."""
    _Cores.count, _Cores.has_pool = count, False
    torch.set_num_threads(count)


def core_count() -> int:
    """Return the number of cores that this process uses."""
    return _Cores.count or torch.get_num_threads()


def limit_torch_threads() -> None:
    """Limit torch to one core and run `parallel_for` on all cores, until the next `set_core_count`."""
    _Cores.count, _Cores.has_pool = core_count(), True
    torch.set_num_threads(1)


def parallel_for(function: Callable[..., None], n: int, *arguments: Any) -> None:
    """Call `function(first, last, *arguments)` for parts of `range(n)`, in parallel after `limit_torch_threads`.

    The parts must be independent and run without gradients.
    """
    threads = core_count() if _Cores.has_pool and not hasattr(_thread, "is_worker") else 1
    if threads == 1 or n <= 1:
        with torch.no_grad():
            function(0, n, *arguments)
        return
    n_parts = min(n, PARTS * threads)
    cuts = [n * part // n_parts for part in range(n_parts + 1)]
    pool = _pool(threads)
    futures = [pool.submit(function, first, last, *arguments) for first, last in itertools.pairwise(cuts)]
    for future in futures:
        future.result()


@lru_cache(maxsize=1)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="karf-core", initializer=_init_worker)


def _init_worker() -> None:
    """Set torch's state per thread, as `runtime.start_runtime` does for the main thread."""
    _thread.is_worker = True
    torch.set_num_threads(1)
    torch.set_grad_enabled(False)
    torch.set_flush_denormal(True)
