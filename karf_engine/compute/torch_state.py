"""Torch's settings of the whole process, which a library must leave as its caller had them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def preserved_torch_state() -> Iterator[None]:
    """Restore torch's number of threads, random state and treatment of denormal numbers after the block.

    Examples:
        >>> import torch
        >>> before = torch.initial_seed()
        >>> with preserved_torch_state():
        ...     _ = torch.manual_seed(before + 1)
        >>> torch.initial_seed() == before
        True
    """
    try:
        import torch
    except ModuleNotFoundError:  # the block says what is missing
        yield
        return
    threads, random_state = torch.get_num_threads(), torch.get_rng_state()
    flushes_denormals = math.ulp(0.0) * 1.0 == 0.0
    try:
        yield
    finally:
        torch.set_num_threads(threads)
        torch.set_rng_state(random_state)
        torch.set_flush_denormal(flushes_denormals)
