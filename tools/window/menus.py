"""Menus: of Blender's topbar, which Python knows only while they are drawn, and of buttons. Runs inside Blender."""

from __future__ import annotations

import re
import time
from collections.abc import Generator

import bpy

from . import hands
from .hands import NotFound, Wait

STEP = 12  # pixels between two looks along the topbar
ROW = 10  # and down a menu
OPENS = 0.3  # seconds in which a busy machine has drawn a menu
LONGEST = 500  # pixels of a menu
SETTLES = 0.1  # seconds in which an item knows that the mouse is over it
WIDEST = 400  # pixels from the left in which the menus are


class _Seen:
    """The topbar, and how often the menu was drawn."""

    area: bpy.types.Area | None = None
    region: bpy.types.Region | None = None
    drawn: int = 0


def choose(menu: str, pattern: str) -> Wait:
    """Open a menu of the topbar and click what does something. Raises NotFound.

    The mouse goes along the menus with one of them open until the wanted one is, which counts as the one click that
    an artist needs, who can read.
    """
    bar, kind = bpy.types.TOPBAR_MT_editor_menus, getattr(bpy.types, menu)
    bar.append(_see_bar)
    kind.append(_see_menu)
    begin = time.monotonic()
    try:
        place = yield from _open()
        yield from _click(place, pattern)
    finally:
        hands.looked(begin)
        bar.remove(_see_bar)
        kind.remove(_see_menu)


def choose_below(where: hands.Where, place: hands.Place, pattern: str) -> Wait:
    """Open the menu of a button and click what does something, wherever the menu opens. Raises NotFound."""
    found = yield from open_below(where, place, pattern)
    yield from hands.click(found)


def open_below(where: hands.Where, place: hands.Place, pattern: str) -> Generator[float, None, hands.Place]:
    """Open the menu of a button and put the mouse over what means something; returns where that is. Raises NotFound."""
    yield from hands.click(place)
    yield OPENS
    begin, meant = time.monotonic(), []
    for way in (-1, 1):
        for away in range(2 * ROW, LONGEST, ROW):
            item = place[0] + STEP // 2, place[1] + way * away
            yield from hands.move(item)
            yield SETTLES
            meant.append(hands.meaning(where))
            if re.search(pattern, meant[-1]):
                hands.looked(begin)
                return item
    raise NotFound(f"no item of the menu is {pattern}; there are {sorted(set(meant))}")


def _see_bar(self, context):
    _Seen.area, _Seen.region = context.area, context.region


def _see_menu(self, context):
    _Seen.drawn += 1


def _open() -> Generator[float, None, hands.Place]:
    y = hands.window().height - STEP
    yield from hands.click((3 * STEP, y))
    for x in range(3 * STEP, WIDEST, STEP):
        yield from hands.move((x, y))
        yield OPENS
        if _Seen.drawn:
            return x, y
    raise NotFound("the menu does not open")


def _click(place: hands.Place, pattern: str) -> Wait:
    x, y = place
    meant = []
    for below in range(2 * ROW, LONGEST, ROW):
        yield from hands.move((x + 2 * STEP, y - below))
        meant.append(_meaning())
        if re.search(pattern, meant[-1]):
            yield from hands.click((x + 2 * STEP, y - below))
            return
    raise NotFound(f"no item of the menu is {pattern}; there are {sorted(set(meant))}")


def _meaning() -> str:
    manager = bpy.data.window_managers[0]
    with bpy.context.temp_override(window=hands.window(), area=_Seen.area, region=_Seen.region):
        if not bpy.ops.ui.copy_python_command_button.poll():
            return ""
        manager.clipboard = ""
        bpy.ops.ui.copy_python_command_button()
        return manager.clipboard
