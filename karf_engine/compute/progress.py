"""Progress events of a job, with rate and remaining time; cancellation, also by Ctrl-C; and peak memory.

`emit(kind, **values)` receives the events of `worker.protocol`.
"""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from ..errors import Cancelled

Emit = Callable[..., None]
INTERVAL = 0.25  # seconds between events


class Progress:
    """Counter of the steps of one stage, which emits `progress` events."""

    def __init__(self, emit: Emit, should_stop: Callable[[], bool], stage: str, total: int) -> None:
        self._emit, self._should_stop, self._stage, self._total = emit, should_stop, stage, total
        self._done = self._first = 0
        self._start = time.monotonic()
        self._last_emit = 0.0

    def resume_at(self, done: int) -> None:
        """Continue the count of an earlier job; rate and remaining time are those of this job."""
        self._done = self._first = done
        self._start = time.monotonic()

    def step(self, count: int = 1, **metrics: float) -> None:
        """Count finished steps, 0 to check for cancellation only, with current metrics. Raises Cancelled."""
        if self._should_stop():
            raise Cancelled(
                "The {stage} stage was cancelled.",
                "What is finished and what is learned so far is kept; start it again when you like.",
                stage=self._stage,
            )
        if count == 0:
            return
        self._done += count
        now = time.monotonic()
        if now - self._last_emit < INTERVAL and self._done < self._total:
            return
        self._last_emit = now
        rate = (self._done - self._first) / max(now - self._start, 1e-6)
        self._emit(
            "progress",
            stage=self._stage,
            step=self._done,
            total=self._total,
            rate=round(rate, 2),
            eta_s=round((self._total - self._done) / rate, 1),
            metrics={name: round(float(value), 4) for name, value in metrics.items()},
        )


class TerminalEmit:
    """Event handler that prints: one live line on a terminal, a line every few seconds in a log."""

    def __init__(self, stream: Any = None, log_interval: float = 5.0) -> None:
        self._stream = stream or sys.stderr
        self._live = self._stream.isatty()
        self._interval = log_interval
        self._last: tuple[str, float] = ("", 0.0)
        self._width = 0

    def __call__(self, kind: str, /, **values: Any) -> None:
        if kind == "progress":
            self._progress(values)
        elif kind == "stage":
            self._line(f"{values['name']}: {values['text']}" if values.get("text") else values["name"])
        elif kind == "warning":
            self._line(f"warning: {values['sentence']}")
        elif kind == "artifact":
            self._line(f"wrote {values['path']}")

    def _progress(self, values: dict[str, Any]) -> None:
        metrics = "".join(f"  {name} {value:g}" for name, value in values["metrics"].items())
        text = (
            f"{values['stage']:<13} {values['step']:>5}/{values['total']}  {values['rate']:7.1f}/s  "
            f"{values['eta_s']:5.0f} s left{metrics}"
        )
        finished = values["step"] >= values["total"]
        if self._live:
            self._stream.write("\r" + text.ljust(self._width) + ("\n" if finished else ""))
            self._stream.flush()
            self._width = 0 if finished else len(text)
            return
        stage, last = self._last
        if finished or stage != values["stage"] or time.monotonic() - last > self._interval:
            self._last = (values["stage"], time.monotonic())
            self._line(text)

    def _line(self, text: str) -> None:
        if self._width:
            self._stream.write("\n")
            self._width = 0
        print(text, file=self._stream, flush=True)


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


def peak_memory_bytes() -> int:
    """Return the largest resident memory of this process so far; 0 if the system does not report it."""
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text(encoding="utf-8").splitlines():
            if line.startswith("VmHWM"):
                return int(line.split()[1]) * 1024
    try:
        import resource
    except ImportError:  # Windows
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
