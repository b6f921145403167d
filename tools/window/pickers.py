"""Swatches under the mouse: their pickers opened, dragged in and closed, keyframes. Runs inside Blender."""

from __future__ import annotations

import time
from collections.abc import Generator

from . import acts, desk, hands
from .acts import Story
from .hands import Wait

STEP = 8  # pixels between two looks for the wheel
PICKER = 340  # pixels above the swatch in which its picker is
LEAST = 100  # pixels: a wheel is wider and higher than the fields below it


def swatch(name: str, index: int) -> str:
    """The pattern of a swatch's field."""
    number = desk.scene().karf.objects.find(name)
    return rf'karf\.objects\[({number}|"{name}")\]\.swatches\[({index}|"[^"]*{index}")\]\.color'


def color_of(name: str, index: int) -> tuple[float, ...]:
    """A swatch as it stands."""
    return desk.swatches()[name][index]


def drag_swatch(story: Story, name: str, index: int, steps: int, angle: tuple[int, int]) -> Generator[float, None, int]:
    """Open a swatch's picker, drag in its wheel, close it; returns how many pictures were seen on the way."""
    start = yield from open_picker(name, index)
    seen = set()
    hands.send("LEFTMOUSE", "PRESS", start)
    yield hands.PAUSE
    for place in way(start, angle, steps):
        hands.send("MOUSEMOVE", "NOTHING", place)
        yield 0.12
        seen.add(desk.picture())
    yield from story.shoot(f"picker-{name}-{index}")
    hands.send("LEFTMOUSE", "RELEASE", place)
    yield 0.2
    yield from close_picker()
    return len(seen)


def open_picker(name: str, index: int) -> Generator[float, None, hands.Place]:
    """Open a swatch's picker; returns the middle of its wheel, where the mouse is then."""
    field = yield from hands.find(acts.SIDEBAR, swatch(name, index), 0.2)
    yield from hands.click(field)
    yield 0.3
    begin = time.monotonic()
    middle = yield from _wheel(field)
    hands.looked(begin)
    yield from hands.move(middle)
    return middle


def _wheel(field: hands.Place) -> Generator[float, None, hands.Place]:
    """The middle of the wheel, which lies above the field that was clicked: what changes the color under the mouse."""
    x, low = field[0], 0
    for y in range(field[1] + 4 * STEP, field[1] + PICKER, STEP):
        is_color = yield from _is_color((x, y))
        if is_color:
            low = low or y
        elif low and y - low >= LEAST:
            break
        else:
            low = 0
    acts.check(bool(low), "the picker has no wheel")
    middle = (low + y - STEP) // 2
    left = yield from _end(x, middle, -STEP)
    right = yield from _end(x, middle, STEP)
    return (left + right) // 2, middle


def _end(x: int, y: int, step: int) -> Generator[float, None, int]:
    while (yield from _is_color((x + step, y))):
        x += step
    return x


def _is_color(place: hands.Place) -> Generator[float, None, bool]:
    yield from hands.move(place)
    yield 0.1
    return hands.meaning(acts.SIDEBAR).endswith(".color")


def way(start: hands.Place, offset: tuple[int, int], steps: int) -> list[hands.Place]:
    """The places on a straight way."""
    return [
        tuple(one + more * number // steps for one, more in zip(start, offset, strict=True))
        for number in range(1, steps + 1)
    ]


def close_picker() -> Wait:
    """Click beside the picker."""
    outside = hands.middle_of(acts.PICTURE)
    yield from hands.move(outside)
    yield from hands.click(outside)
    yield 0.3


def key_swatch(name: str, index: int) -> Wait:
    """I over a swatch: a keyframe of its color."""
    place = yield from hands.find(acts.SIDEBAR, swatch(name, index), 0.2)
    yield from hands.press("I", place)
