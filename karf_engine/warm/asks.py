"""What is asked on a stream, line by line: of each kind the latest alone counts."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterable

from ..errors import BadRequest
from ..wire import CANCEL, Ask


class Asks:
    """The asks that wait, the oldest first.

    Args:
        lines: A stream, read in a thread of its own: reading blocks.
        on_drop: Called with each ask that a later one of its kind has replaced before it was taken.
        on_stray: Called with what is wrong with a line that is no ask.
    """

    def __init__(
        self, lines: Iterable[str], on_drop: Callable[[Ask], None], on_stray: Callable[[BadRequest], None]
    ) -> None:
        self._on_drop, self._on_stray = on_drop, on_stray
        self._arrived: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._waiting: dict[str, Ask] = {}
        self._is_over = False
        threading.Thread(target=self._read, args=(lines,), daemon=True).start()

    def take(self, seconds: float) -> Ask | None:
        """The ask that has waited longest; None where none came in so many seconds, or none will."""
        self._take_in()
        while not self._waiting and not self._is_over:
            try:
                self._add(self._arrived.get(timeout=seconds))
            except queue.Empty:
                return None
            self._take_in()
        return None if self._is_over else self._waiting.pop(next(iter(self._waiting)))

    def has_later(self, kind: str) -> bool:
        """Whether an ask of this kind waits, or the caller is gone: what is being answered is wanted no more."""
        self._take_in()
        return kind in self._waiting or self._is_over

    def _take_in(self) -> None:
        while not self._arrived.empty():
            self._add(self._arrived.get())

    def _add(self, line: str | None) -> None:
        if line is None:
            self._is_over = True
            return
        try:
            ask = Ask.decode(line)
        except BadRequest as error:
            self._on_stray(error)
            return
        replaced = self._waiting.pop(ask.kind, None)
        self._waiting[ask.kind] = ask
        if replaced is not None:
            self._on_drop(replaced)

    def _read(self, lines: Iterable[str]) -> None:
        for line in lines:
            if line.strip() == CANCEL:
                break
            self._arrived.put(line)
        self._arrived.put(None)
