"""Swatches by mouse and keys. Runs inside Blender."""

from __future__ import annotations

import bpy

from . import acts, desk, hands, pickers
from .acts import BESIDE_PICTURE, FILM_FRAMES, PICTURE, VIEW, Story, check
from .hands import Wait
from .telling import Chapter

CHAPTER = Chapter()
SWATCH_EYE = 0.09  # of the sidebar's width: the eye below an object's first swatch


@CHAPTER.step("drag", "mouse: a swatch's picker is opened, its color dragged")
def drag(story: Story) -> Wait:
    before = pickers.color_of("pot", 1)
    seen = yield from pickers.drag_swatch(story, "pot", 1, 10, (-45, 25))
    yield from story.shoot("dragged")
    story.note(f"{before} became {pickers.color_of('pot', 1)}; {seen} pictures on the way")
    check(pickers.color_of("pot", 1) != before, "the swatch did not change")
    check(seen >= 4, f"the picture followed only {seen} times")
    check(desk.is_in_step(), "the picture is not what the swatches say")
    story.facts["dragged"] = desk.picture()


@CHAPTER.step("undo, redo", "keys: Ctrl Z, Ctrl Shift Z")
def undo(story: Story) -> Wait:
    yield from hands.press("Z", hands.middle_of(VIEW), ctrl=True)
    yield 0.5
    check(desk.picture() == story.facts["learned"], "undo did not bring the picture back")
    check(desk.is_in_step(), "after undo the picture is not what the swatches say")
    yield from hands.press("Z", hands.middle_of(VIEW), ctrl=True, shift=True)
    yield 0.5
    check(desk.picture() == story.facts["dragged"], "redo did not bring the edit back")


@CHAPTER.step(
    "looks", "mouse: Keep Look, a swatch dragged, Keep Look, the first look chosen; keys: V over the picture, Ctrl Z"
)
def looks(story: Story) -> Wait:
    karf, first = desk.scene().karf, desk.picture()
    yield from hands.press_button(BESIDE_PICTURE, r"karf\.keep_look\(")
    yield from pickers.drag_swatch(story, "pot", 1, 6, (40, -35))
    second = desk.picture()
    yield from hands.press_button(BESIDE_PICTURE, r"karf\.keep_look\(\)")
    check(karf.looks.keys() == ["A", "B"], f"the looks are {karf.looks.keys()}")
    yield from story.shoot("looks")
    yield from hands.press_button(BESIDE_PICTURE, r'karf\.choose_look\(name="A"\)')
    check(desk.picture() == first and desk.is_in_step(), "a click on the first look does not bring its picture")
    yield from hands.press("V", hands.middle_of(PICTURE))
    check(desk.picture() == second and karf.look == "B", "V does not flip to the other look")
    yield from hands.press("Z", hands.middle_of(VIEW), ctrl=True)
    yield 0.5
    karf = desk.scene().karf
    check(desk.picture() == first and karf.look == "A", f"undo does not flip back: {karf.look} is in use")
    yield from story.shoot("looks-flipped")


@CHAPTER.step("before and after", "keys: C over the picture; mouse: the eyes of an object and of a swatch")
def before_and_after(story: Story) -> Wait:
    edited, seeing = desk.picture(), bpy.data.window_managers[0].karf_seeing
    seen = []
    for way in (
        lambda: hands.press("C", hands.middle_of(PICTURE)),
        lambda: hands.press_button(BESIDE_PICTURE, r'karf\.solo_swatch\(object_name="pot", index=0\)'),
        lambda: hands.press_button(BESIDE_PICTURE, r'karf\.solo_swatch\(object_name="pot"(, index=1)?\)', SWATCH_EYE),
    ):
        yield from way()
        seen.append(desk.picture())
        yield from story.shoot(f"looked-at-{seeing.mode.lower()}-{seeing.solo_swatch}")
        yield from way()
        check(desk.picture() == edited, f"the second time does not lead back from {seeing.mode}")
    check(len({edited, *seen}) == 4, "two ways of looking show the same picture")


@CHAPTER.step("add a color", "mouse: the eyedropper, a click on the pot under the loupe; keys: Ctrl Z")
def add_color(story: Story) -> Wait:
    before, picture = desk.swatches(), desk.pixels()
    yield from hands.press_button(BESIDE_PICTURE, r'karf\.add_color\(object_name="pot"')
    place = acts.on_photo(*desk.middle_of("pot"))
    yield from hands.move(place)
    yield 0.3
    yield from story.shoot("loupe")
    yield from hands.click(place)
    yield 0.3
    yield from story.shoot("color-added")
    check(len(desk.swatches()["pot"]) == 2 * len(before["pot"]), "no color was added")
    # its weights are those of the swatches, divided: a byte may be rounded otherwise
    check(desk.difference(picture) <= 1, "a color that is added changes the picture")
    yield from hands.press("Z", hands.middle_of(VIEW), ctrl=True)
    yield 0.5
    check(desk.swatches() == before, "undo left the added color")


@CHAPTER.step("keyframe", "keys: I over a swatch, Shift Right, another drag, I; then Left and Right")
def keyframe(story: Story) -> Wait:
    scene = desk.scene()
    scene.frame_start, scene.frame_end = 1, FILM_FRAMES
    scene.frame_set(1)
    yield from pickers.key_swatch("mug", 1)
    yield from hands.press("RIGHT_ARROW", hands.middle_of(VIEW), shift=True)
    check(scene.frame_current == FILM_FRAMES, f"Shift Right went to frame {scene.frame_current}")
    yield from pickers.drag_swatch(story, "mug", 1, 6, (50, -10))
    yield from pickers.key_swatch("mug", 1)
    check(desk.animated_objects() == {"mug"}, f"keyframes are on {desk.animated_objects()}")
    last = desk.picture()
    for _ in range(3):
        yield from hands.press("LEFT_ARROW", hands.middle_of(VIEW))
    yield from story.shoot("keyframed")
    check(scene.frame_current == FILM_FRAMES - 3, f"three times Left went to frame {scene.frame_current}")
    check(desk.picture() != last, "the picture does not follow the frame")
    check(desk.is_in_step(), "the picture is not what the swatches say in this frame")


@CHAPTER.step("save again", "keys: Ctrl S")
def save_again(story: Story) -> Wait:
    yield from acts.save_file()
