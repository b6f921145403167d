"""The shortest way from an empty file to a recolored picture, counted and timed. Runs inside Blender.

An artist's own settings stay as they are; only the file browser is kept in the window, where it can be seen.
"""

from __future__ import annotations

import time

import bpy

from . import acts, desk, hands, menus, pickers
from .acts import PICTURE, STEPS, VIEW, Story, check, until
from .hands import Wait
from .telling import Chapter

CHAPTER = Chapter()
TO_BLUE = 45, 35  # from the middle of a picker's wheel, pixels
OBJECT = "object"  # as the extension calls the first
MOST_BEFORE, MOST_AFTER = 8, 2  # interactions until it learns, and from then to the first recolored picture
MASK_SECONDS, LEARNING_SECONDS, LOOK_SECONDS = 120, 7200, 120


def reach(story: Story, milestone: str) -> Wait:
    """A milestone: how many interactions and seconds after the empty file; and a screenshot.

    The seconds in which the story looks for buttons do not count: an artist can read.
    """
    seconds = round(time.monotonic() - story.facts["start"] - hands.looking_seconds(), 1)
    story.facts["milestones"].append([milestone, hands.interactions(), seconds])
    story.note(f"{milestone}: {hands.interactions()} interactions, {seconds:.0f} s")
    yield from story.shoot(milestone)


def width_of_picture() -> int:
    """How wide the Image Editor's picture is on the screen, in pixels."""
    return acts.on_photo(1, 0)[0] - acts.on_photo(0, 0)[0]


@CHAPTER.step(
    "install", "script: Install from Disk, the engine's Python in the preferences; keys: Esc closes the splash screen"
)
def install(story: Story) -> Wait:
    yield from acts.install(story)
    yield from hands.press("ESC", hands.middle_of(VIEW))


@CHAPTER.step("workspace", "mouse: Window, KaRF Workspace")
def workspace(story: Story) -> Wait:
    hands.start_counting()
    story.facts |= {"start": time.monotonic(), "milestones": []}
    yield from menus.choose("TOPBAR_MT_window", r"karf\.open_workspace")
    yield from until(lambda: hands.window().workspace.name == "KaRF", "the workspace", 10)
    yield from until(lambda: acts.editors("IMAGE_EDITOR") == 1, "its Image Editor", 10)
    yield from until(lambda: hands.region_of(STEPS).active_panel_category == acts.TAB, "the KaRF tab", 10)
    yield from story.shoot("workspace")


@CHAPTER.step("import", "mouse: Import Capture; path by script, button clicked")
def import_capture(story: Story) -> Wait:
    yield from hands.press_button(STEPS, r"karf\.import_capture")
    yield from acts.file_browser(story.desk / story.job["capture"])
    karf = desk.scene().karf
    check(len(karf.views) == story.job["views"], f"{len(karf.views)} views, not {story.job['views']}")
    yield from until(lambda: karf.marking.photo is not None, "the photo to mark", 10)
    yield from reach(story, "imported")
    tool = hands.window().workspace.tools.from_space_image_mode("VIEW")
    check(tool.idname == "karf.mark_box", f"{tool.idname} is taken up, not the box")
    check([item.name for item in karf.marking.objects] == [OBJECT], "there is no object to mark")


@CHAPTER.step("preset, view", "wheel: Ctrl over Preset; keys: Page Down. As often as the capture needs")
def choose(story: Story) -> Wait:
    karf = desk.scene().karf
    while karf.preset != story.job["preset"]:
        place = yield from hands.find(STEPS, r"karf\.preset")
        yield from hands.turn_wheel(place)
    width = width_of_picture()
    while karf.active_view != story.job["view"]:
        yield from hands.press("PAGE_DOWN", hands.middle_of(PICTURE))
    check(width_of_picture() == width, "another view's photo is not as wide on the screen")


@CHAPTER.step("mark", "mouse: a box dragged around the object")
def mark(story: Story) -> Wait:
    corner, other = (acts.on_photo(*place) for place in story.job["box"])
    middle = [round((one + two) / 2) for one, two in zip(corner, other, strict=True)]
    yield from hands.drag([corner, middle, other])
    read, queries = desk.module("project.disk").read, desk.module("tasks.queries")
    yield from until(lambda: read(desk.scene()).masks == {OBJECT: 1}, "the engine's mask", MASK_SECONDS)
    check(not queries.is_waiting("propose"), "the engine is still at work")
    yield from reach(story, "marked")
    story.facts["mask"] = mask_folder()


def mask_folder() -> str:
    """Where the object's masks are; saving moves them with the project."""
    return str(desk.module("marking.objects").masks_folder(desk.scene()) / OBJECT)


@CHAPTER.step("learn", "mouse: Learn All; script: the file is saved; key: Return, the project moves beside it")
def learn(story: Story) -> Wait:
    runner, progress = desk.module("tasks.runner"), bpy.data.window_managers[0].karf_progress
    yield from hands.press_button(STEPS, r"karf\.learn_all")
    yield from until(runner.is_running, "the job", 10)
    before, width = hands.interactions(), width_of_picture()
    yield from reach(story, "pressed")
    yield from hands.move(hands.middle_of(PICTURE))
    end = time.monotonic() + LEARNING_SECONDS
    while runner.is_running() and time.monotonic() < end:
        next_look = time.monotonic() + LOOK_SECONDS
        while runner.is_running() and time.monotonic() < next_look:
            yield 0.2
        story.note(f"{progress.stage}: {progress.fraction:.0%}")
    yield from acts.job_end(story)
    yield from reach(story, "learned")
    yield from keep(story)
    story.facts["mask"] = mask_folder()
    story.facts["project"] = str(desk.module("project.folders").project_of(desk.scene()).folder)
    check(before <= MOST_BEFORE, f"{before} interactions lie before learning, more than {MOST_BEFORE}")
    check(desk.is_in_step(), "the picture is not what the swatches say")
    tool = hands.window().workspace.tools.from_space_image_mode("VIEW")
    check(not tool.idname.startswith("karf."), f"{tool.idname} stays in hand over the picture")
    check(width_of_picture() == width, "the learned picture is not as wide on the screen as the photo")


def keep(story: Story) -> Wait:
    """Save the file, for `--only` too; the project, begun in an unsaved file, moves beside it when asked."""
    bpy.ops.wm.save_as_mainfile(filepath=str(story.home / "first_color.blend"))
    story.facts["blend"] = bpy.data.filepath
    yield 1.0
    yield from story.shoot("move-project")
    yield from hands.press("RET", hands.middle_of(PICTURE))
    hands.count(-1)  # an artist would save later
    project_of = desk.module("project.folders").project_of
    yield from until(lambda: project_of(desk.scene()).folder.parent == story.home, "the project beside the file", 30)
    yield 0.5


@CHAPTER.step("first color", "mouse: a swatch's picker is opened, its color dragged")
def first_color(story: Story) -> Wait:
    before, learned = hands.interactions(), desk.picture()
    swatches = desk.swatches()[OBJECT]
    index = max(range(1, len(swatches)), key=lambda number: max(swatches[number]) - min(swatches[number]))
    start = yield from pickers.open_picker(OBJECT, index)
    yield from hands.drag([start, *pickers.way(start, TO_BLUE, 10)])
    yield 0.5
    check(desk.picture() != learned, "the picture did not change")
    yield from reach(story, "first color")
    after = hands.interactions() - before
    story.note(f"{swatches[index]} became {pickers.color_of(OBJECT, index)}")
    yield from pickers.close_picker()
    yield from story.shoot("recolored")
    asked = [image.name for image in bpy.data.images if image.is_dirty]
    check(not asked, f"Blender would ask whether to save {asked}")
    check(desk.is_in_step(), "the picture is not what the swatches say")
    check(after <= MOST_AFTER, f"{after} interactions lie between learning and the first color, more than {MOST_AFTER}")
