"""Swatches under the mouse: their pickers opened, dragged in and closed, keyframes. Runs inside Blender."""

from __future__ import annotations

from collections.abc import Generator

from . import acts, desk, hands
from .acts import Story
from .hands import Wait

STEP = 4  # pixels between two looks for an edge
PICKER = 206  # its width; pixels of the screen, as all here
WHEEL = 91, 223  # from the picker's left edge, and from the swatch's upper one, to the middle of the wheel
STATUS_BAR = 8  # pixels from the window's lower edge


def of_object(name: str, part: str) -> str:
    """The pattern of the field of an object's property."""
    number = desk.scene().karf.objects.find(name)
    return rf'karf\.objects\[({number}|"{name}")\]\.{part}'


def swatch(name: str, index: int, part: str = "color") -> str:
    """The pattern of the field of a swatch's property."""
    return of_object(name, rf'swatches\[({index}|"[^"]*{index}")\]\.{part}')


def color_of(name: str, index: int) -> tuple[float, ...]:
    """A swatch as it stands."""
    return desk.swatches()[name][index]


def drag_swatch(story: Story, name: str, index: int, steps: int, angle: tuple[int, int]) -> Generator[float, None, int]:
    """Open a swatch's picker, drag in its wheel, close it; returns how many pictures were seen on the way."""
    before = color_of(name, index)
    for is_right in (None, True, False):
        seen = yield from _drag(story, name, index, steps, angle, is_right)
        if color_of(name, index) != before:
            break  # else the picker was at the other side of where it was looked for, and closed
    return seen


def _drag(
    story: Story, name: str, index: int, steps: int, angle: tuple[int, int], is_right: bool | None
) -> Generator[float, None, int]:
    """The same where the picker is looked for at one side alone, see `open_picker`."""
    start = yield from open_picker(name, index, is_right)
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


def open_picker(name: str, index: int, is_right: bool | None = None) -> Generator[float, None, hands.Place]:
    """Open a swatch's picker; returns the middle of its wheel, where the mouse is then.

    The picker lies above the swatch, both left edges in line, or the right ones where the window ends before (None);
    within some pixels of that only Blender knows.
    """
    field = yield from hands.find(acts.BESIDE_PICTURE, swatch(name, index), 0.2)
    ends = []
    for step in ((-STEP, 0), (STEP, 0), (0, STEP)):
        ends.append((yield from hands.edge(acts.BESIDE_PICTURE, swatch(name, index), field, step)))
    (left, _), (right, _), (_, top) = ends
    yield from hands.click(field)
    yield 0.3
    if is_right is None:
        is_right = right + PICKER >= hands.window().width
    start = right - PICKER if is_right else left
    middle = start + WHEEL[0], top + WHEEL[1]
    yield from hands.move(middle)
    return middle


def way(start: hands.Place, offset: tuple[int, int], steps: int) -> list[hands.Place]:
    """The places on a straight way."""
    return [
        tuple(one + more * number // steps for one, more in zip(start, offset, strict=True))
        for number in range(1, steps + 1)
    ]


def close_picker() -> Wait:
    """Click beside the picker, on the status bar: where the picker went when the mouse did, a click means nothing there."""
    outside = hands.window().width // 2, STATUS_BAR
    yield from hands.move(outside)
    yield from hands.click(outside)
    yield 0.3


def key_swatch(name: str, index: int) -> Wait:
    """I over a swatch: a keyframe of its color."""
    place = yield from hands.find(acts.BESIDE_PICTURE, swatch(name, index), 0.2)
    yield from hands.press("I", place)
