"""Queries of every kind, answered one at a time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...errors import BadRequest
from .kinds import QUERIES
from .session import Session


class Answering:
    """Answers the queries of one job, in whose folder the files of answers lie; what they need is kept from one query to the next."""

    def __init__(self, folder: Path, threads: int | None = None, device: str | None = None) -> None:
        self._session = Session(folder, threads, device)

    def answer(self, kind: str, options: dict[str, Any], is_superseded: Callable[[], bool]) -> dict[str, Any]:
        """Answer a query.

        Args:
            kind: One of `QUERIES`.
            options: Its own.
            is_superseded: Whether a later query of this kind waits.

        Returns:
            The answer's JSON values, paths as text.

        Raises:
            BadRequest: There is no such kind.
            KarfError: It cannot be answered.
            Cancelled: A later one waits.
        """
        if kind not in QUERIES:
            raise BadRequest(f"Unknown kind of query {kind!r:.200}.", f"Use one of: {', '.join(QUERIES)}.")
        self._session.is_superseded = is_superseded
        return QUERIES[kind](self._session, options)

    def forget(self) -> None:
        """Let go of all that is kept."""
        self._session.forget()
