"""Mouse and keys in a Blender window that was started with --enable-event-simulate. Runs inside Blender.

Every function that moves the mouse is a generator: it yields the seconds that Blender needs to take the events in.
Places are window coordinates, from the lower left corner. Buttons are found by hovering: Blender itself says what the
button under the mouse does (Copy Python Command, Copy Data Path), so the story does not depend on how panels look.
"""

from __future__ import annotations

import re
import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass

import bpy

Place = tuple[int, int]
Wait = Generator[float, None, None]
PAUSE = 0.03  # seconds in which Blender takes an event in
SETTLED = 0.2  # seconds after which a button knows that the mouse is over it, also on a busy machine
ROW = 13  # pixels between two rows of a search; the lowest buttons are about 18 high
EMPTY_ROWS = 26  # consecutive rows without a button after which the panels end
EDGE_STEPS = 200  # at most, from a button to its edge
RIGHT = 0.845  # where a sidebar has the small button at the end of a row
COLUMNS = (0.45, RIGHT, 0.2, 0.68, 0.32, 0.57)  # of a region's width, in the order of a search


class NotFound(Exception):
    """There is no such button."""


@dataclass(frozen=True)
class Where:
    """A region of the window, by the types of its editor and of itself."""

    editor: str
    region: str = "UI"


def window() -> bpy.types.Window:
    """The main window; loading a file makes a new one."""
    return bpy.data.window_managers[0].windows[0]


def area_of(editor: str) -> bpy.types.Area:
    """The largest editor of a type in the window. Raises NotFound."""
    found = [area for area in window().screen.areas if area.type == editor]
    if not found:
        raise NotFound(f"there is no {editor} in the window")
    return max(found, key=lambda area: area.width * area.height)


def region_of(where: Where) -> bpy.types.Region:
    """The region itself. Raises NotFound."""
    for region in area_of(where.editor).regions:
        if region.type == where.region and region.width > 1:
            return region
    raise NotFound(f"{where.editor} has no {where.region}")


def middle_of(where: Where, share: float = 0.5) -> Place:
    """The middle of a region; share: of its width."""
    region = region_of(where)
    return region.x + int(region.width * share), region.y + region.height // 2


def inside(where: Where):
    """The context of a region, for operators that ask for it."""
    return bpy.context.temp_override(window=window(), area=area_of(where.editor), region=region_of(where))


class _Count:
    """How often the mouse or a key was used, and the seconds in which buttons were looked for."""

    interactions: int = 0
    looking: float = 0.0


def start_counting() -> None:
    """Count anew."""
    _Count.interactions, _Count.looking = 0, 0.0


def interactions() -> int:
    """How often the mouse or a key was used: a click, a key, a drag, a typed text are one each; looking is none."""
    return _Count.interactions


def count(more: int = 1) -> None:
    """Add interactions that are done otherwise than by what is here."""
    _Count.interactions += more


def looking_seconds() -> float:
    """The seconds in which buttons were looked for, by hovering."""
    return _Count.looking


def looked(begin: float) -> None:
    """A search that began at this time (monotonic) is over."""
    _Count.looking += time.monotonic() - begin


# --- events --------------------------------------------------------------------------------------------------------
def send(kind: str, value: str, place: Place, **modifiers) -> None:
    """One event."""
    window().event_simulate(type=kind, value=value, x=int(place[0]), y=int(place[1]), **modifiers)


def move(place: Place) -> Wait:
    """Move the mouse; the second event is the one that a region takes as the mouse over a button."""
    for _ in range(2):
        send("MOUSEMOVE", "NOTHING", place)
        yield PAUSE


def click(place: Place, **modifiers) -> Wait:
    """A click of the left mouse button."""
    count()
    yield from move(place)
    for value in ("PRESS", "RELEASE"):
        send("LEFTMOUSE", value, place, **modifiers)
        yield PAUSE
    yield 0.3


def drag(places: Sequence[Place]) -> Wait:
    """Press at the first place, move through the others and let go at the last."""
    count()
    yield from move(places[0])
    send("LEFTMOUSE", "PRESS", places[0])
    yield PAUSE
    for place in places[1:]:
        send("MOUSEMOVE", "NOTHING", place)
        yield PAUSE
    send("LEFTMOUSE", "RELEASE", places[-1])
    yield 0.3


def press(kind: str, place: Place, **modifiers) -> Wait:
    """A key with the mouse at a place."""
    count()
    yield from move(place)
    for value in ("PRESS", "RELEASE"):
        send(kind, value, place, **modifiers)
        yield PAUSE
    yield 0.3


def turn_wheel(place: Place) -> Wait:
    """The wheel down by a notch over a field, with Ctrl: its next choice."""
    count()
    yield from move(place)
    send("WHEELDOWNMOUSE", "PRESS", place, ctrl=True)
    yield 0.3


def write(text: str, place: Place, **modifiers) -> Wait:
    """Put text into the field at a place: click into it (a name in a list: with Ctrl), replace all, Return."""
    yield from click(place, **modifiers)
    yield from press("A", place, ctrl=True)
    for letter in text:
        kind = letter.upper() if letter.isalpha() else "PERIOD"
        send(kind, "PRESS", place, unicode=letter)
        send(kind, "RELEASE", place)
        yield PAUSE
    yield from press("RET", place)
    count(-2)  # a click, two keys and the letters are one


# --- buttons -------------------------------------------------------------------------------------------------------
def meaning(where: Where) -> str:
    """What the button under the mouse does: `bpy.ops...` of an operator, `bpy.data...` of a property, else nothing."""
    manager = bpy.data.window_managers[0]
    with inside(where):
        for copy, options in (
            (bpy.ops.ui.copy_python_command_button, {}),
            (bpy.ops.ui.copy_data_path_button, {"full_path": True}),
        ):
            if copy.poll():
                manager.clipboard = ""
                try:
                    copy(**options)
                except RuntimeError:  # a property that has no path
                    continue
                if manager.clipboard:
                    return manager.clipboard
    return ""


_seen: dict[Where, dict[str, Place]] = {}


def find(where: Where, pattern: str, first: float = COLUMNS[0]) -> Generator[float, None, Place]:
    """The place of the first button whose meaning matches a regular expression; first: where to look first. Raises
    NotFound."""
    begin = time.monotonic()
    try:
        return (yield from _search(where, pattern, first))
    finally:
        looked(begin)


def _search(where: Where, pattern: str, first: float) -> Generator[float, None, Place]:
    seen = _seen.setdefault(where, {})
    for known in [place for meant, place in seen.items() if re.search(pattern, meant)]:
        place = yield from _settled(where, pattern, known)
        if place:
            return place
    seen.clear()  # the panels have moved
    region = region_of(where)
    for share in dict.fromkeys([first, *COLUMNS]):
        x = region.x + int(region.width * share)
        empty = 0
        yield from move((x, region.y + region.height - ROW))
        for y in range(region.y + region.height - ROW, region.y, -ROW):
            send("MOUSEMOVE", "NOTHING", (x, y))
            yield PAUSE
            meant = meaning(where)
            empty = 0 if meant else empty + 1
            if meant:
                seen.setdefault(meant, (x, y))
            if re.search(pattern, meant):
                place = yield from _settled(where, pattern, (x, y))
                if place:
                    return place
            if empty > EMPTY_ROWS:
                break
    raise NotFound(f"no button of {where.editor} {where.region} is {pattern}; there are {sorted(seen)}")


def _settled(where: Where, pattern: str, place: Place) -> Generator[float, None, Place | None]:
    """The place itself or one just above: a busy machine may have answered for where the mouse was before."""
    for above in (0, ROW, 2 * ROW):
        x, y = place[0], place[1] + above
        yield from move((x, y))
        yield SETTLED
        if re.search(pattern, meaning(where)):
            return x, y
    return None


def edge(where: Where, pattern: str, place: Place, step: Place) -> Generator[float, None, Place]:
    """The last place along a direction (pixels a step) that is still the button's, from a place in it. Raises NotFound."""
    begin = time.monotonic()
    for _ in range(EDGE_STEPS):
        yield from move(place)
        yield 0.1
        if not re.search(pattern, meaning(where)):
            looked(begin)
            return place[0] - step[0], place[1] - step[1]
        place = place[0] + step[0], place[1] + step[1]
    raise NotFound(f"{pattern} has no edge: a popup is open, which answers for every place")


def press_button(where: Where, pattern: str, first: float = COLUMNS[0]) -> Wait:
    """Find a button and click it."""
    place = yield from find(where, pattern, first)
    yield from click(place)
