"""Controls in panels, found by hovering: Blender tells what the button under the mouse does (Copy Python Command, Copy Data
Path), so nothing depends on the layout of panels. Runs inside Blender.
"""

from __future__ import annotations

import re
from collections.abc import Generator

import bpy

from . import desk, hands
from .desk import Broken
from .hands import BESIDE_PICTURE, Place, Wait, Where

SETTLED = 0.2  # seconds after which a button knows that the mouse is over it, also on a busy machine
ROW = 13  # pixels between two rows of a search; the lowest buttons are about 18 high
EMPTY_ROWS = 26  # consecutive rows without a button after which the panels end
EDGE_STEPS = 200  # at most, from a button to its edge
RIGHT = 0.845  # where a sidebar has the small button at the end of a row
COLUMNS = 0.45, RIGHT, 0.2, 0.68, 0.32, 0.57  # of a region's width, in the order of a search
SWATCH = (
    r'karf\.objects\[(0|"[^"]*")\]\.swatches\[[^]]+\]\.color'  # of the first object; the leftmost is used throughout
)
# of the color picker: its width, and the middle of its wheel from its left and upper edge, and from its lower one
PICKER, WHEEL, WHEEL_Y = 206, 91, 223
STEPS, DRAG_PAUSE = 8, 0.12  # of a drag in it
STATUS_BAR = 8  # pixels from the window's lower edge


def meaning(where: Where) -> str:
    """Return the button under the mouse: `bpy.ops...` of an operator, `bpy.data...` of a property, else nothing."""
    manager = bpy.data.window_managers[0]
    with hands.inside(where):
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


def find(where: Where, pattern: str, first: float = COLUMNS[0]) -> Generator[float, None, Place]:
    """Return the place of the first button whose meaning matches a regular expression, or raise Broken.

    The search begins in the column `first`, a share of the region's width.
    """
    region, seen = hands.region_of(where), set()
    top = region.y + region.height - ROW
    for share in dict.fromkeys([first, *COLUMNS]):
        x, empty = region.x + int(region.width * share), 0
        yield from hands.move((x, top))
        for y in range(top, region.y, -ROW):
            hands.send("MOUSEMOVE", "NOTHING", (x, y))
            yield hands.PAUSE
            meant = meaning(where)
            seen.add(meant)
            if re.search(pattern, meant):
                place = yield from _settled(where, pattern, (x, y))
                if place:
                    return place
            empty = 0 if meant else empty + 1
            if empty > EMPTY_ROWS:
                break
    raise Broken(f"no button of {where.editor} {where.region} is {pattern}; there are {sorted(seen)}")


def _settled(where: Where, pattern: str, place: Place) -> Generator[float, None, Place | None]:
    """Return the place or one just above: a busy machine may have answered for where the mouse was before."""
    for above in (0, ROW, 2 * ROW):
        x, y = place[0], place[1] + above
        yield from hands.move((x, y))
        yield SETTLED
        if re.search(pattern, meaning(where)):
            return x, y
    return None


def press_button(where: Where, pattern: str, first: float = COLUMNS[0]) -> Wait:
    """Find a button and click it."""
    place = yield from find(where, pattern, first)
    yield from hands.click(place)


def open_step(where: Where, page: str) -> Wait:
    """Click the heading of a step, which has the button of its page of the manual."""
    region = hands.region_of(where)
    _, y = yield from find(where, rf"karf\.open_manual\(page='{page}'\)", RIGHT)
    yield from hands.click((region.x + int(0.3 * region.width), y))


# --- swatches --------------------------------------------------------------------------------------------------------
def find_swatch() -> Generator[float, None, Place]:
    """Return the place of the swatch."""
    return (yield from find(BESIDE_PICTURE, SWATCH, 0.2))


def drag_swatch(way: tuple[int, int]) -> Generator[float, None, int]:
    """Open the swatch's picker, drag from the middle of its wheel by some pixels, and close it.

    The picker opens above the swatch, or below where there is no room, aligned with its left edge, or with its right
    one near the window's edge. If the first guess changes nothing, the other is tried.

    Returns:
        The number of different pictures on the way.
    """
    before = desk.swatches()
    field = yield from find_swatch()
    meant = meaning(BESIDE_PICTURE)
    left, _ = yield from _edge(field, (-4, 0), meant)
    right, _ = yield from _edge(field, (4, 0), meant)
    _, top = yield from _edge(field, (0, 4), meant)
    _, bottom = yield from _edge(field, (0, -4), meant)
    is_above = top + WHEEL_Y + WHEEL < hands.window().height
    starts = [left, right - PICKER]
    for start in starts if right + PICKER < hands.window().width else reversed(starts):
        x, y, seen = start + WHEEL, top + WHEEL_Y if is_above else bottom - WHEEL, set()
        yield from hands.click(field)
        yield from hands.move((x, y))
        places = [(x + way[0] * step // STEPS, y + way[1] * step // STEPS) for step in range(STEPS + 1)]
        for pause in hands.drag(places, DRAG_PAUSE):
            yield pause
            seen.add(desk.picture())
        outside = hands.window().width // 2, STATUS_BAR
        yield from hands.move(outside)
        yield from hands.click(outside)
        if desk.swatches() != before:
            return len(seen)
    raise Broken("the picker is at neither edge of its swatch")


def _edge(place: Place, step: Place, meant: str) -> Generator[float, None, Place]:
    """Return the last place along a direction of the button that means this."""
    for _ in range(EDGE_STEPS):
        following = place[0] + step[0], place[1] + step[1]
        yield from hands.move(following)
        yield 0.1
        if meaning(BESIDE_PICTURE) != meant:
            return place
        place = following
    raise Broken("the swatch has no edge: a popup is open, which answers for every place")
