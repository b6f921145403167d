"""Ctrl-C as a request to stop, so that what was learned so far is saved."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from ..errors import Cancelled


@contextmanager
def stop_on_interrupt(should_stop: Callable[[], bool] | None = None) -> Iterator[Callable[[], bool]]:
    """Turn the first Ctrl-C in the block into a request to stop; a second one interrupts at once.

    Args:
        should_stop: Another reason to stop.

    Yields:
        A function that returns whether to stop.

    Raises:
        KeyboardInterrupt: The block has stopped after a Ctrl-C.
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
