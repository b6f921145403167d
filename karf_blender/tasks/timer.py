"""One timer of Blender polls what runs beside the interface: a modal operator would hold back auto-save for as long.

In background mode timers never fire: there tasks and queries block. What runs ends with Blender and with the extension.
"""

import traceback
from collections.abc import Callable
from dataclasses import dataclass, field

from .. import session

FIRST_SECONDS = 0.02

Poll = Callable[[], float | None]  # returns the seconds until it wants to be called again; None: no more


@dataclass
class _State:
    """What is called."""

    polls: list[Poll] = field(default_factory=list)


def start(poll: Poll) -> None:
    """Have a function called, soon and then as often as it says."""
    if poll not in session.get(_State).polls:
        session.get(_State).polls.append(poll)
    session.start_timer(_tick, FIRST_SECONDS, persistent=True)


def _tick() -> float | None:
    seconds = [wanted for poll in tuple(session.get(_State).polls) if (wanted := _called(poll)) is not None]
    return min(seconds, default=FIRST_SECONDS if session.get(_State).polls else None)


def _called(poll: Poll) -> float | None:
    seconds = None
    try:
        seconds = poll()
    except Exception:  # as Blender prints it, which would stop the other functions too
        traceback.print_exc()
    if seconds is None and poll in session.get(_State).polls:
        session.get(_State).polls.remove(poll)
    return seconds
