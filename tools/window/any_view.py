"""The recolored scene from wherever one looks: the 3D View turned by mouse, a swatch dragged beside it, F12. Runs inside
Blender."""

from __future__ import annotations

import math
import time
from collections.abc import Generator, Iterator

import bpy

from . import acts, desk, hands, pickers
from .acts import VIEW, Story, check, until
from .first_color import OBJECT
from .hands import Place, Wait
from .telling import Chapter

CHAPTER = Chapter()
SECONDS = 5.0  # of each gesture
EVENT_SECONDS = 0.015  # between two events of a mouse that moves
# pictures a second: of a card, or where the window is drawn in software a share of what Blender draws without us
ENOUGH, LEAST = {"turned": 15, "dragged": 10}, {"turned": 0.8, "dragged": 0.4}
RADIUS = 40  # pixels around the middle of a picker's wheel


class _Count:
    """Pictures that have come, counted where the 3D View takes them."""

    pictures = 0


def count_pictures() -> None:
    """Begin to count."""
    viewport = desk.module("render_engine.viewport")
    take = viewport.Viewport._take
    if getattr(take, "is_counted", False):
        return

    def counted(*given) -> None:
        _Count.pictures += 1
        take(*given)

    counted.is_counted = True
    viewport.Viewport._take = counted


def gesture(story: Story, name: str, button: str, places: Iterator[Place]) -> Wait:
    """Move the mouse with a button held, for a while; what comes meanwhile is counted, and held against the least."""
    start = next(places)
    yield from hands.move(start)
    hands.send(button, "PRESS", start)
    yield hands.PAUSE
    begin, before = time.monotonic(), _Count.pictures
    while time.monotonic() < begin + SECONDS:
        place = next(places)
        hands.send("MOUSEMOVE", "NOTHING", place)
        yield EVENT_SECONDS
    rate = (_Count.pictures - before) / (time.monotonic() - begin)
    yield from story.shoot(name)
    hands.send(button, "RELEASE", place)
    region = hands.region_of(VIEW)
    story.note(f"{name}: {rate:.1f} pictures a second, a 3D View of {region.width} x {region.height}")
    story.facts[f"{name} pictures a second"] = round(rate, 1)
    least = min(ENOUGH[name], LEAST[name] * story.facts["redraws"])
    check(rate >= least, f"fewer than {least:.1f}")


def redraws() -> float:
    """How often a second Blender draws its window, with the 3D View in Solid."""
    begin = time.monotonic()
    bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=10)
    return round(10 / (time.monotonic() - begin), 1)


def around(middle: Place, radius: int, height: int) -> Iterator[Place]:
    """Places on an ellipse, for ever."""
    number = 0
    while True:
        angle = number / 12
        yield middle[0] + int(radius * math.cos(angle)), middle[1] + int(height * math.sin(angle))
        number += 1


def whole_picture(seconds: float = 60) -> Wait:
    """Wait until no picture is on its way."""
    count, still_since = -1, time.monotonic()
    end = time.monotonic() + seconds
    while time.monotonic() < still_since + 1.5:
        check(time.monotonic() < end, "the 3D View does not come to rest")
        if _Count.pictures != count or desk.module("tasks.queries").is_waiting("show"):
            count, still_since = _Count.pictures, time.monotonic()
        yield 0.1


@CHAPTER.step("splats", "script: Learn Splats")
def splats(story: Story) -> Wait:
    with hands.inside(VIEW):
        yield from acts.job_begin(_pressed(bpy.ops.karf.learn_splats), "karf.learn_splats")
    yield from acts.job_end(story)
    check("splats" in desk.module("project.disk").contents_of(desk.scene()).stages, "there are no splats")


def _pressed(operator) -> Wait:
    operator()
    yield 0.1


@CHAPTER.step("rendered view", "script: overlays off, Rendered View, and the 3D View looks through the camera")
def rendered_view(story: Story) -> Wait:
    count_pictures()
    desk.scene().view_settings.view_transform = "Standard"
    space = hands.area_of("VIEW_3D").spaces.active
    space.overlay.show_overlays = space.show_gizmo = space.show_region_ui = False
    with hands.inside(VIEW):
        story.facts["redraws"] = redraws()
        story.note(f"Blender alone draws its window {story.facts['redraws']} times a second")
        bpy.ops.karf.rendered_view()
        space.region_3d.view_perspective = "CAMERA"
    before = _Count.pictures
    yield from until(lambda: _Count.pictures > before, "the first picture", 60)
    yield from whole_picture()
    yield from story.shoot("rendered-camera")


@CHAPTER.step("turn", "mouse: the 3D View is turned with the middle button")
def turn(story: Story) -> Wait:
    yield from gesture(story, "turned", "MIDDLEMOUSE", around(hands.middle_of(VIEW), 120, 20))
    yield from whole_picture()
    yield from story.shoot("turned-still")


@CHAPTER.step("drag", "mouse: a swatch is dragged beside the 3D View")
def drag(story: Story) -> Generator[float, None, None]:
    swatches = desk.swatches()[OBJECT]
    index = max(range(1, len(swatches)), key=lambda number: max(swatches[number]) - min(swatches[number]))
    middle = yield from pickers.open_picker(OBJECT, index)
    yield from gesture(story, "dragged", "LEFTMOUSE", around(middle, RADIUS, RADIUS))
    yield from pickers.close_picker()
    yield from whole_picture()
    yield from story.shoot("dragged-still")


@CHAPTER.step("F12", "keys: F12")
def still(story: Story) -> Wait:
    file = story.desk / "still.png"
    yield from acts.render_image(file)
    check(file.is_file(), "there is no picture")
    story.note(f"rendered by {desk.scene().render.engine}")
    yield from story.shoot("still")
