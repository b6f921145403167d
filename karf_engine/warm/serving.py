"""The warm engine's loop: take an ask, answer it, until nobody asks any more."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from ..compute.progress import Emit
from ..errors import BadRequest, Cancelled, KarfError, OutOfMemory
from ..path_map import PathMap
from ..wire import Ask
from .answers import ANSWERS
from .asks import Asks
from .session import Session

IDLE_MINUTES = 10


def serve(
    session: Session,
    lines: Iterable[str],
    emit: Emit,
    explained: Callable[[Exception], KarfError],
    paths: PathMap,
    idle_minutes: float = IDLE_MINUTES,
) -> None:
    """Answer asks until their stream ends, or none came for a while.

    An ask is answered by one event: `answer` with the values of its kind, `refused`, or `dropped` where a later one of
    its kind has replaced it.

    Args:
        session: What is kept between asks.
        lines: One ask each, see `wire.Ask`.
        emit: Receives the events.
        explained: Makes an error that a user can read of any other.
        paths: Of folders that the caller knows by other paths.
        idle_minutes: How long to wait for the next ask.
    """
    asks = Asks(
        lines,
        on_drop=lambda ask: emit("dropped", id=ask.number),
        on_stray=lambda error: emit("warning", code=error.code, sentence=error.sentence),
    )
    while (ask := asks.take(60 * idle_minutes)) is not None:
        session.is_superseded = lambda kind=ask.kind: asks.has_later(kind)
        try:
            emit("answer", id=ask.number, **_answer(session, ask, paths))
        except Cancelled:
            emit("dropped", id=ask.number)
        except Exception as raised:
            error = explained(raised)
            if isinstance(error, OutOfMemory):
                session.forget()
            emit("refused", id=ask.number, code=error.code, sentence=error.sentence, hint=error.hint)


def _answer(session: Session, ask: Ask, paths: PathMap) -> dict[str, Any]:
    if ask.kind not in ANSWERS:
        raise BadRequest(f"Unknown kind of ask {ask.kind!r:.200}.", f"Use one of: {', '.join(ANSWERS)}.")
    return ANSWERS[ask.kind](session, paths.here(ask.options))
