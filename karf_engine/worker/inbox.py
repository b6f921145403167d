"""Read a worker's standard input: cancel, folders of next jobs, and queries."""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Iterable

from ..compute.progress import Emit
from ..errors import BadRequest
from .protocol import CANCEL, Query, decode_line


class Inbox:
    """Queue of waiting messages: job folders in order, and the latest query of each kind.

    Args:
        emit: Receives `dropped` for a waiting query that a later one of its kind replaces, and `warning` for a line that
            is neither a folder nor a query.
    """

    def __init__(self, emit: Emit) -> None:
        self._emit = emit
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._folders: deque[str] = deque()
        self._queries: dict[str, Query] = {}
        self._cancelled = threading.Event()

    def listen(self, lines: Iterable[str]) -> None:
        """Start a thread that reads a stream."""
        threading.Thread(target=self._read, args=(lines,), daemon=True).start()

    def is_cancelled(self) -> bool:
        """Return whether the line `cancel` or the end of input (the caller is gone) has arrived."""
        return self._cancelled.is_set()

    def next_folder(self, seconds: float) -> str | None:
        """Wait for the folder of the next job; return None on timeout or cancel."""
        self._sort()
        while not self._folders and self._wait(seconds):
            pass
        return None if self.is_cancelled() or not self._folders else self._folders.popleft()

    def next_query(self, seconds: float) -> Query | None:
        """Wait for a query and return the oldest; return None on timeout or cancel, or if a job is waiting."""
        self._sort()
        while not self._queries and not self._folders and self._wait(seconds):
            pass
        if self.is_cancelled() or not self._queries:
            return None
        return self._queries.pop(next(iter(self._queries)))

    def is_superseded(self, kind: str) -> bool:
        """Return whether a later query of this kind is waiting, or the caller is gone."""
        self._sort()
        return kind in self._queries or self.is_cancelled()

    def _wait(self, seconds: float) -> bool:
        """Wait for a line and sort all lines that arrived; return False on timeout or cancel."""
        if self.is_cancelled():
            return False
        try:
            self._add(self._lines.get(timeout=seconds))
        except queue.Empty:
            return False
        self._sort()
        return True

    def _sort(self) -> None:
        while not self._lines.empty():
            self._add(self._lines.get())

    def _add(self, line: str | None) -> None:
        if line is None:  # end of input
            return
        try:
            message = decode_line(line)
        except BadRequest as error:
            self._emit("warning", code=error.code, sentence=error.sentence)
            return
        if isinstance(message, str):
            self._folders.append(message)
            return
        replaced = self._queries.pop(message.kind, None)
        self._queries[message.kind] = message
        if replaced is not None:
            self._emit("dropped", id=replaced.number)

    def _read(self, lines: Iterable[str]) -> None:
        for line in lines:
            if line.strip() == CANCEL:
                break
            self._lines.put(line)
        self._cancelled.set()
        self._lines.put(None)
