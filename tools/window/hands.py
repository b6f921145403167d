"""Mouse and keys in a window of Blender with --enable-event-simulate. Runs inside Blender.

Each function that uses them is a generator, which yields the seconds that Blender needs for the events. Places are
window coordinates, from the lower left corner.
"""

from __future__ import annotations

import traceback
from collections.abc import Generator, Sequence
from dataclasses import dataclass

import bpy

Place = tuple[int, int]
Wait = Generator[float, None, None]
PAUSE = 0.03  # seconds that Blender needs for an event
AFTER = 0.3  # seconds after a click or a key
gestures: list[str] = []  # clicks, keys and drags so far


@dataclass(frozen=True)
class Where:
    """A region of the window, by the types of its editor and of itself."""

    editor: str
    region: str = "UI"


VIEW, PICTURE = Where("VIEW_3D", "WINDOW"), Where("IMAGE_EDITOR", "WINDOW")
SIDEBAR, BESIDE_PICTURE = Where("VIEW_3D"), Where("IMAGE_EDITOR")  # the sidebars: of the steps, of marks and swatches


def window() -> bpy.types.Window:
    """Return the main window; loading a file makes a new one."""
    return bpy.data.window_managers[0].windows[0]


def area_of(editor: str) -> bpy.types.Area:
    """Return the largest editor of a type in the window."""
    found = [area for area in window().screen.areas if area.type == editor]
    return max(found, key=lambda area: area.width * area.height)


def region_of(where: Where) -> bpy.types.Region:
    """Return the region itself."""
    return next(each for each in area_of(where.editor).regions if each.type == where.region and each.width > 1)


def middle_of(where: Where) -> Place:
    """Return the middle of a region."""
    region = region_of(where)
    return region.x + region.width // 2, region.y + region.height // 2


def in_picture(u: float, v: float) -> Place:
    """Return where a place of the picture, in shares from the lower left, is displayed in the Image Editor."""
    region = region_of(PICTURE)
    x, y = region.view2d.view_to_region(u, v, clip=False)
    return x + region.x, y + region.y


def inside(where: Where):
    """Return a region's context, for operators that need it."""
    return bpy.context.temp_override(window=window(), area=area_of(where.editor), region=region_of(where))


def send(kind: str, value: str, place: Place, **modifiers) -> None:
    """Send one event."""
    window().event_simulate(type=kind, value=value, x=int(place[0]), y=int(place[1]), **modifiers)


def move(place: Place) -> Wait:
    """Move the mouse; a button notices it only at the second event."""
    for _ in range(2):
        send("MOUSEMOVE", "NOTHING", place)
        yield PAUSE


def press(kind: str, place: Place, **modifiers) -> Wait:
    """Press and release a key with the mouse at a place."""
    gestures.append(kind)
    yield from move(place)
    for value in ("PRESS", "RELEASE"):
        send(kind, value, place, **modifiers)
        yield PAUSE
    yield AFTER


def click(place: Place) -> Wait:
    """Click with the left mouse button."""
    yield from press("LEFTMOUSE", place)


def drag(places: Sequence[Place], pause: float = PAUSE) -> Wait:
    """Press at the first place, move through the others with pauses, and release at the last."""
    gestures.append("drag")
    yield from move(places[0])
    send("LEFTMOUSE", "PRESS", places[0])
    yield PAUSE
    for place in places[1:]:
        send("MOUSEMOVE", "NOTHING", place)
        yield pause
    send("LEFTMOUSE", "RELEASE", places[-1])
    yield AFTER


def play(scenes: Wait) -> None:
    """Run a generator in a timer, so that the window is drawn between two events, and quit Blender at its end."""

    def tick() -> float | None:
        try:
            return next(scenes)
        except StopIteration:
            pass
        except BaseException:
            traceback.print_exc()
        bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(tick, first_interval=1.0, persistent=True)
