"""What must last: another folder, another session, palettes extracted anew, the extension off and on. Runs inside Blender."""

from __future__ import annotations

import shutil
from pathlib import Path

import bpy

from . import acts, desk, hands, pickers, remains
from .acts import BESIDE_PICTURE, FILM_FRAMES, PICTURE, STEPS, VIEW, Story, check, until
from .hands import Wait
from .telling import Chapter

CHAPTER = Chapter()


@CHAPTER.step(
    "save elsewhere", "keys: Ctrl Shift S into a folder beside another project of the same name; path by script"
)
def save_elsewhere(story: Story) -> Wait:
    folders, place = desk.module("project.folders"), story.home / "sub"
    # one where the new .blend would look for a project of this name, one where its new path leads from the old folder
    for decoy in (place / "pots_karf", story.desk / "pots_karf"):
        shutil.copytree(story.job["decoy"], decoy, dirs_exist_ok=True)
    before = desk.swatches(), folders.project_of(desk.scene()).folder, desk.picture(), desk.animated_objects()
    yield from acts.save_file_as(place / "story.blend")
    yield 0.5
    story.facts["blend"] = bpy.data.filepath
    after = desk.swatches(), folders.project_of(desk.scene()).folder, desk.picture(), desk.animated_objects()
    for what, one, other in zip(("swatches", "project", "picture", "keyframes"), before, after, strict=True):
        check(one == other, f"Save As changed the {what}: {one} became {other}")
    story.note(f"the project is {desk.scene().karf.project}")


@CHAPTER.step("reload", "keys: Ctrl O; path by script, button clicked")
def reload(story: Story) -> Wait:
    before = desk.swatches(), desk.picture(), desk.animated_objects(), desk.scene().frame_current
    yield from hands.press("O", hands.middle_of(VIEW), ctrl=True)
    blend = Path(bpy.data.filepath)
    yield from acts.file_browser(blend.parent, blend.name)
    yield 2.0
    yield from acts.show_tab()
    yield from story.shoot("reloaded")
    after = desk.swatches(), desk.picture(), desk.animated_objects(), desk.scene().frame_current
    for what, one, other in zip(("swatches", "pixels", "keyframes", "frame"), before, after, strict=True):
        check(one == other, f"other {what} after the reload: {one} became {other}")
    check(desk.is_in_step(), "the picture is not what the swatches say")
    shown = hands.area_of("IMAGE_EDITOR").spaces.active.image
    check(shown == desk.scene().karf.result, f"the Image Editor shows {shown and shown.name} after the reload")


@CHAPTER.step("re-extract with keys", "mouse: a third object, Segment, Extract Palette; Return where Blender asks")
def extract_again(story: Story) -> Wait:
    karf = desk.scene().karf
    karf.active_view = story.job["masked_view"]
    edited = pickers.color_of("pot", 1)
    yield from acts.open_step("mark")
    yield from hands.press_button(BESIDE_PICTURE, r"karf\.mark\(")
    with hands.inside(PICTURE):
        bpy.ops.image.view_all(fit_view=True)
    yield from hands.press_button(BESIDE_PICTURE, r"karf\.add_object", hands.RIGHT)
    yield from acts.mark(story, 2, "apple")
    folding = bpy.data.window_managers[0].karf_folding
    yield from until(lambda: folding.show_segment, "Segment's opening, which is stale,", 10)
    yield from acts.button_job(story, r"karf\.segment\(")
    yield from hands.press_button(STEPS, r"karf\.extract_palette")
    yield 0.5
    yield from story.shoot("asked")
    # there are edits, and Blender asks first
    yield from acts.job_begin(hands.press("RET", hands.middle_of(PICTURE)), "karf.extract_palette")
    yield from acts.job_end(story)
    yield from story.shoot("extracted-again")
    check(set(desk.swatches()) == {"apple", "mug", "pot"}, f"the objects are {list(desk.swatches())}")
    check(desk.animated_objects() == {"mug"}, f"the mug's keyframes went to {desk.animated_objects() or 'nobody'}")
    desk.scene().frame_set(1)
    first = desk.picture()
    desk.scene().frame_set(FILM_FRAMES)
    check(desk.picture() != first, "the keyframed picture does not follow any more")
    pot = desk.swatches()["pot"]  # in a new order, perhaps: an edit stays with the paint that it was of
    check(edited in pot, f"the pot's edit {edited} is not among {pot}")
    check(karf.looks.keys() == ["A", "B"], f"the looks are {karf.looks.keys()}")


@CHAPTER.step("disable, enable", "script: the extension is switched off and on")
def disable_enable(story: Story) -> Wait:
    before = desk.swatches()
    bpy.ops.preferences.addon_disable(module=desk.PACKAGE)
    yield 1.0
    left = remains.remains(desk.PACKAGE)
    yield from story.shoot("disabled")
    bpy.ops.preferences.addon_enable(module=desk.PACKAGE)
    acts.choose_engine(story)  # else `--only` has none from now on: Blender forgets an extension's preferences
    yield 1.0
    yield from acts.show_tab()
    check(not left, f"a disabled extension leaves {left}")
    check(desk.swatches() == before, "the swatches are others after disabling and enabling")
    learned = desk.picture()
    yield from pickers.drag_swatch(story, "pot", 1, 6, (-30, -30))
    yield from story.shoot("enabled")
    check(desk.picture() != learned and desk.is_in_step(), "swatches have no effect after enabling again")
