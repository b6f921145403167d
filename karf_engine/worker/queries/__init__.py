"""Queries: short questions about a project, answered from memory.

Queries only read projects, so they may run beside any job of another worker. Their files are written below the folder of
the answering job. Packages beyond numpy and those of pictures are imported within the functions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...errors import BadRequest
from .photos import chart, correct, inspect, masks, photo, propose
from .renders import harmonics, preview, show
from .session import Query, Session

QUERIES: dict[str, Query] = {
    "chart": chart,
    "correct": correct,
    "harmonics": harmonics,
    "inspect": inspect,
    "masks": masks,
    "photo": photo,
    "preview": preview,
    "propose": propose,
    "show": show,
}


def answer(session: Session, kind: str, options: dict[str, Any], is_superseded: Callable[[], bool]) -> dict[str, Any]:
    """Answer a query of one of the `QUERIES`. Raises KarfErrors: Cancelled if `is_superseded`, by a later one of its kind.

    Raises BadRequest if the kind or an option is wrong.
    """
    if kind not in QUERIES:
        raise BadRequest(f"Unknown kind of query {kind!r:.200}.", f"Use one of: {', '.join(QUERIES)}.")
    session.is_superseded = is_superseded
    return QUERIES[kind](session, options)
