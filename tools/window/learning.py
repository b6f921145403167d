"""The story's first half: from an empty file to an object's swatches. Runs inside Blender."""

from __future__ import annotations

from pathlib import Path

import bpy

from . import acts, controls, desk, hands
from .desk import MARKED_VIEW, PHOTO_SIZE, check, until
from .hands import BESIDE_PICTURE, PICTURE, SIDEBAR, VIEW, Wait, Where
from .record import Chapter, Story, engine_processes
from .remains import remains

CHAPTER = Chapter()
TOOLBAR = Where("IMAGE_EDITOR", "TOOLS")
N_PHOTOS = 72
# over the teapot in the photo of the marked view: row, first and last column
STROKES = (176, 208, 276), (208, 196, 296), (240, 192, 304), (272, 208, 288), (288, 220, 272)


@CHAPTER.step("script: Install from Disk, the engine's Python in the preferences")
def install(story: Story) -> Wait:
    """The built package can be enabled in an empty file, and finds its engine."""
    preferences = bpy.context.preferences
    preferences.view.show_splash = preferences.view.show_tooltips = False  # nothing lies over what events hit
    preferences.view.filebrowser_display_type = "SCREEN"
    preferences.system.use_region_overlap = False
    package = str(Path(story.job["out"]) / "karf.zip")
    bpy.ops.extensions.package_install_files(filepath=package, repo="user_default", enable_on_install=True)
    check(desk.PACKAGE in preferences.addons, "the extension is not enabled after its installation")
    acts.choose_engine(story.job)
    acts.open_advanced()
    yield from until(lambda: not desk.module("preferences.state").known().problem, "the engine")
    held = remains(desk.PACKAGE)
    for kind in ("handler", "drawing", "class", "property"):
        check(any(line.startswith(kind) for line in held), f"no {kind} is found: the search for what stays is blind")
    story.note(f"Blender {bpy.app.version_string}, in which the extension holds {len(held)} things")
    bpy.ops.wm.save_userpref()
    yield from hands.press("ESC", hands.middle_of(VIEW))  # the splash screen


@CHAPTER.step("script: KaRF Workspace; keys: Ctrl Shift S; path by script, button clicked")
def open_workspace(story: Story) -> Wait:
    """The workspace shows the KaRF tab beside the 3D View and the picture, and is saved with the file."""
    with hands.inside(VIEW):
        bpy.ops.karf.open_workspace()
    yield from until(lambda: hands.window().workspace.name == "KaRF", "the workspace")
    yield from until(lambda: acts.editors("IMAGE_EDITOR") == 1, "its Image Editor")
    for where in (SIDEBAR, BESIDE_PICTURE):
        yield from until(lambda where=where: hands.region_of(where).active_panel_category == acts.TAB, "the KaRF tab")
    yield from story.shoot()
    yield from acts.save_file_as(story.desk / "story.blend")


@CHAPTER.step("mouse: Import Capture; path by script, button clicked; keys: Ctrl S")
def import_capture(story: Story) -> Wait:
    """Every photo becomes a view, the first one is there to be marked, and the project is beside the file."""
    yield from controls.press_button(SIDEBAR, r"karf\.import_capture")
    yield from acts.choose_file(story.desk / "pots")
    karf = desk.scene().karf
    check(len(karf.views) == N_PHOTOS, f"there are {len(karf.views)} views, not {N_PHOTOS}")
    check(karf.project == "//pots_karf", f"the project is {karf.project!r}")
    yield from until(lambda: karf.marking.photo is not None, "the photo to mark")
    yield from story.shoot()
    yield from acts.save_file()


@CHAPTER.step("script: the preset; mouse: Learn Scene, then the cross")
def cancel_a_job(story: Story) -> Wait:
    """A cancelled job ends with its process, and its stage does not count as done."""
    progress = bpy.data.window_managers[0].karf_progress
    desk.scene().karf.preset = "demo"
    yield from acts.begin_job(controls.press_button(SIDEBAR, r"karf\.learn_scene"))
    yield from until(lambda: progress.fraction > 0, "progress", acts.JOB_SECONDS)
    check(any("timer" in line for line in remains(desk.PACKAGE)), "no timer is found: the search is blind")
    check(is_learning(story), "no process of the engine is found: the search is blind")
    yield from story.shoot()
    yield from controls.press_button(SIDEBAR, r"karf\.cancel", controls.RIGHT)
    yield from acts.end_job("cancelled")
    check(not is_learning(story), "the engine's process still runs")
    check("geometry" not in desk.stages(), "a cancelled stage counts as done")


def is_learning(story: Story) -> bool:
    """Return whether a process of the engine learns the scene."""
    return any("-geometry" in process for process in engine_processes(story.desk))


@CHAPTER.step("mouse: Learn Scene")
def learn(story: Story) -> Wait:
    """The smallest preset learns the scene."""
    yield from acts.press_job(r"karf\.learn_scene")
    yield from story.shoot()
    check("geometry" in desk.stages(), "the scene is not learned")


@CHAPTER.step("script: a view; mouse: Mark in Photo, the brush from the toolbar, strokes; keys: Ctrl Z")
def mark(story: Story) -> Wait:
    """Strokes of the brush are the object's mask, and undo takes one back."""
    desk.scene().karf.active_view = MARKED_VIEW
    yield from controls.press_button(BESIDE_PICTURE, r"karf\.mark\(")
    yield from acts.fit_picture()
    yield from controls.press_button(TOOLBAR, r"karf\.mark_brush", 0.5)
    for row, first, last in STROKES:
        v = 1 - row / PHOTO_SIZE
        yield from hands.drag([hands.in_picture(column / PHOTO_SIZE, v) for column in range(first, last, 12)])
    yield from story.shoot()
    mask = desk.mask()
    story.note(f"{(mask > 127).mean():.1%} of the photo are marked")
    check(all(mask[row, (first + last) // 2] > 127 for row, first, last in STROKES), "a stroke is not in the mask")
    check(mask[10, 10] < 128, "the mask is not of the object alone")
    yield from hands.drag([hands.in_picture(0.1, 0.9), hands.in_picture(0.3, 0.9)])
    check((desk.mask() != mask).any(), "the brush does not paint")
    yield from hands.press("Z", hands.middle_of(PICTURE), ctrl=True)
    check((desk.mask() == mask).all(), "undo does not take the stroke back")


@CHAPTER.step("mouse: Segment, Extract Palette; keys: Ctrl S")
def segment_and_palette(story: Story) -> Wait:
    """The object has swatches, and the picture is what they say."""
    yield from acts.press_job(r"karf\.segment\(")
    check("segmentation" in desk.stages(), "nothing is segmented")
    yield from acts.press_job(r"karf\.extract_palette")
    yield from acts.fit_picture()
    yield from story.shoot()
    check(len(desk.swatches()) > 1, f"the swatches are {desk.swatches()}")
    check(desk.is_in_step(), "the picture is not what the swatches say")
    yield from acts.save_file()
