"""What the caller writes on a worker's standard input: to stop, the folders of next jobs, and queries."""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Iterable

from ..compute.progress import Emit
from ..errors import BadRequest
from .protocol import CANCEL, Query, decode_line


class Inbox:
    """What has come and waits: folders in their order, and of each kind of query the latest.

    Args:
        emit: Receives `dropped` for a query that a later one of its kind has replaced before it was taken, and
            `warning` for a line that is neither a folder nor a query.
    """

    def __init__(self, emit: Emit) -> None:
        self._emit = emit
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._folders: deque[str] = deque()
        self._queries: dict[str, Query] = {}
        self._cancelled = threading.Event()

    def listen(self, lines: Iterable[str]) -> None:
        """Begin to read a stream, in a thread of its own: reading blocks."""
        threading.Thread(target=self._read, args=(lines,), daemon=True).start()

    def is_cancelled(self) -> bool:
        """Whether the line `cancel`, or the end of input (the caller is gone), asked to stop."""
        return self._cancelled.is_set()

    def next_folder(self, seconds: float) -> str | None:
        """Wait for the folder of a next job; None where none came in time, or none will."""
        self._sort()
        while not self._folders and self._wait(seconds):
            pass
        return None if self.is_cancelled() or not self._folders else self._folders.popleft()

    def next_query(self, seconds: float) -> Query | None:
        """Wait for a query, the oldest of those that wait; None where none came in time, none will, or a job waits."""
        self._sort()
        while not self._queries and not self._folders and self._wait(seconds):
            pass
        if self.is_cancelled() or not self._queries:
            return None
        return self._queries.pop(next(iter(self._queries)))

    def is_superseded(self, kind: str) -> bool:
        """Whether a query of this kind waits, or the caller is gone: what is being answered is no longer wanted."""
        self._sort()
        return kind in self._queries or self.is_cancelled()

    def _wait(self, seconds: float) -> bool:
        """Wait for a line, and sort it with all that came meanwhile; False where none came in time, or none will."""
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
        if line is None:  # the end, which wakes up who waits
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
