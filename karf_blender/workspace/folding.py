"""Which steps are folded: a step that becomes done folds with those before it, and the next opens.

What the user folds or opens by hand stays so until the next step is done. The steps' states are compared whenever the
disk was read; what is open belongs to the session.
"""

from dataclasses import dataclass, field

import bpy

from .. import session
from ..host import windows
from ..project import disk
from . import states
from .states import DONE, RUNNING, STALE, STEPS

# marking continues after the first mask, alongside the next step, and folds with it
FOLDERS = ("import", "learn", "segment", "palette")


@dataclass
class _State:
    """The scene that was looked at last, and how its steps stood."""

    scene: int | None = None
    kinds: dict[str, str] = field(default_factory=dict)


def opened(before: dict[str, str], after: dict[str, str]) -> dict[str, bool]:
    """Which steps to open or fold after their states have changed; others stay as they are.

    Args:
        before: The states of the steps, empty where nothing is known of the scene yet.
        after: The states as they are now.
    """
    if not before:
        return {step: step in _next(after) for step in STEPS}
    stale = {step: True for step in STEPS if after[step] == STALE != before[step]}
    done = [step for step in (*FOLDERS, "mark") if after[step] == DONE != before[step]]
    if not done:
        return stale
    last = max((STEPS.index(step) for step in done if step in FOLDERS), default=-1)
    return dict.fromkeys(STEPS[: last + 1], False) | dict.fromkeys(_next(after), True) | stale


def _next(kinds: dict[str, str]) -> tuple[str, ...]:
    """The steps to work on: the first that is not done, with marking alongside learning, which needs no marks."""
    first = next((step for step in STEPS if kinds[step] != DONE), "edit")
    return ("learn", "mark") if first == "learn" and kinds["mark"] != DONE else (first,)


@session.listener(disk.READ)
def update() -> None:
    """Fold and open the panels of the main window's scene where its steps have changed."""
    scene = bpy.data.window_managers[0].windows[0].scene
    kinds = {step: states.state_of(scene, step).kind for step in STEPS}
    if RUNNING in kinds.values():  # how it stands is known when it has ended
        return
    before = session.get(_State).kinds if scene.session_uid == session.get(_State).scene else {}
    if kinds == before:
        return
    session.get(_State).scene, session.get(_State).kinds = scene.session_uid, kinds
    folding = bpy.data.window_managers[0].karf_folding
    for step, is_open in opened(before, kinds).items():
        setattr(folding, f"show_{step}", is_open)
    windows.redraw(*windows.PANEL_AREAS)


@session.handler("load_pre")
def _forget(*_):
    session.get(_State).scene, session.get(_State).kinds = None, {}
