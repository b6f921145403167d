"""The registry of queries: each is a function of the session and the query's options that returns JSON values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...errors import BadRequest
from .chart import chart
from .correct import correct
from .harmonics import harmonics
from .inspect import inspect
from .masks import masks
from .preview import preview
from .propose import propose
from .session import Session
from .show import show

# packages beyond numpy are imported within the functions
QUERIES: dict[str, Callable[[Session, dict[str, Any]], dict[str, Any]]] = {
    "chart": chart,
    "correct": correct,
    "harmonics": harmonics,
    "inspect": inspect,
    "masks": masks,
    "preview": preview,
    "propose": propose,
    "show": show,
}


def answer(session: Session, kind: str, options: dict[str, Any], is_superseded: Callable[[], bool]) -> dict[str, Any]:
    """Answer a query.

    Args:
        session: The cache, and the folder of answers.
        kind: One of `QUERIES`.
        options: The query's options.
        is_superseded: Returns whether a later query of this kind is waiting.

    Returns:
        The answer's JSON values, paths as text.

    Raises:
        BadRequest: The kind is unknown.
        KarfError: The query cannot be answered.
        Cancelled: A later query of this kind is waiting.
    """
    if kind not in QUERIES:
        raise BadRequest(f"Unknown kind of query {kind!r:.200}.", f"Use one of: {', '.join(QUERIES)}.")
    session.is_superseded = is_superseded
    return QUERIES[kind](session, options)
