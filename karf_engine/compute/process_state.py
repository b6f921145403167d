"""State of the whole process that a call of the library restores: the handler of Ctrl-C and torch's settings."""

from __future__ import annotations

import math
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from ..errors import Cancelled


@contextmanager
def stop_on_interrupt(should_stop: Callable[[], bool] | None = None) -> Iterator[Callable[[], bool]]:
    """Turn the first Ctrl-C in the block into a request to stop; a second one interrupts at once.

    Yields a function that returns whether to stop, for this reason or `should_stop`. Raises KeyboardInterrupt when the
    block has stopped after a Ctrl-C.
    """
    stop = threading.Event()

    def is_stopped() -> bool:
        return stop.is_set() or (should_stop is not None and should_stop())

    def interrupt(number: int, frame: FrameType | None) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:  # the caller's own handler
        yield is_stopped
        return
    signal.signal(signal.SIGINT, interrupt)
    try:
        yield is_stopped
    except Cancelled:
        if stop.is_set():
            raise KeyboardInterrupt from None
        raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def preserved_torch_state() -> Iterator[None]:
    """Restore torch's number of threads, random state and treatment of denormal numbers after the block."""
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
