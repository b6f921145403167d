"""The story of an artist's afternoon, step by step, with what must hold after each. Runs inside Blender.

A step is a generator: it yields the seconds to wait until Blender resumes it. Its `how` says by what it is done: mouse
and keys are events in the window; what no event can reach in a sensible time is done by script.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy

from . import acts, desk, hands, remains
from .acts import JOB_SECONDS, PICTURE, SIDEBAR, TAB, VIEW, Story, check, until
from .hands import Wait, Where

FILM_FRAMES = 60


@dataclass(frozen=True)
class Step:
    """A step: its name, how it is done, and the generator that does it."""

    name: str
    how: str
    run: Callable[[Story], Wait]


STEPS: list[Step] = []


def step(name: str, how: str):
    """Add a generator function to the story."""

    def add(run: Callable[[Story], Wait]):
        STEPS.append(Step(name, how, run))
        return run

    return add


@step("install", "script: Install from Disk, the engine's Python in the preferences")
def install(story: Story) -> Wait:
    view = bpy.context.preferences.view
    view.show_splash = view.show_tooltips = False
    view.filebrowser_display_type, view.render_display_type = "SCREEN", "NONE"
    # the sidebar beside the picture, not over it, where strokes would hit it
    bpy.context.preferences.system.use_region_overlap = False
    bpy.ops.extensions.package_install_files(filepath=story.job["package"], repo="user_default", enable_on_install=True)
    check(desk.PACKAGE in bpy.context.preferences.addons, "the extension is not enabled after its installation")
    held = remains.remains(desk.PACKAGE)
    for kind in ("handler", "drawing", "class", "property"):
        check(any(line.startswith(kind) for line in held), f"no {kind} of the extension is found: the check is blind")
    story.note(f"the extension holds {len(held)} things in Blender")
    preferences = desk.module("preferences").current()
    preferences.engine_python, preferences.threads = story.job["engine_python"], story.job["threads"]
    bpy.ops.karf.examine_engine()
    probing, python = desk.module("engine.probing"), Path(preferences.engine_python)
    yield from until(lambda: probing.verdict_on(python) is not None, "Test Engine's verdict", 120)
    verdict = probing.verdict_on(python)
    story.note(verdict.sentence)
    check(verdict.is_ready, f"Test Engine says {verdict.sentence!r}")
    bpy.ops.wm.save_userpref()


@step("sidebar", "keys: Esc closes the splash screen; script: editors and sidebars are opened")
def sidebar(story: Story) -> Wait:
    yield from hands.press("ESC", hands.middle_of(VIEW))  # a first start's splash screen takes the next key
    yield from acts.set_up_screen()
    first = {kind: hands.region_of(Where(kind)).active_panel_category for kind in ("VIEW_3D", "IMAGE_EDITOR")}
    yield from acts.show_tab()
    yield from story.shoot("sidebar")
    check(TAB not in first.values(), f"{TAB} takes the place of the first tab: {first}")


@step("save", "keys: Ctrl Shift S; path by script, button clicked")
def save(story: Story) -> Wait:
    yield from acts.save_file_as(story.home / "story.blend")
    story.facts["blend"] = bpy.data.filepath


@step("import", "mouse: Import Capture; path by script, button clicked")
def import_capture(story: Story) -> Wait:
    yield from hands.press_button(SIDEBAR, r"karf\.import_capture")
    yield from acts.file_browser(story.desk / "pots")
    karf = desk.scene().karf
    story.note(f"{len(karf.views)} views, project {karf.project}")
    yield from story.shoot("import")
    check(len(karf.views) == story.job["views"], f"{len(karf.views)} views, not {story.job['views']}")
    check(karf.project == "//pots_karf", f"the project is {karf.project!r}")
    yield from acts.save_file()


@step("learn, cancel", "mouse: Learn Scene with the preset, then the cross")
def learn_cancel(story: Story) -> Wait:
    yield from hands.press_button(SIDEBAR, r"karf\.learn_scene")
    progress = bpy.data.window_managers[0].karf_progress
    yield from until(lambda: progress.fraction > 0, "progress", JOB_SECONDS)
    check(any("timer" in line for line in remains.remains(desk.PACKAGE)), "no timer is found: the check is blind")
    yield from story.shoot("learning")
    yield from hands.press_button(SIDEBAR, r"karf\.cancel", hands.RIGHT)
    yield from acts.job_end(story, "cancelled")
    check(
        "geometry" not in desk.module("project.contents").finished_stages(desk.scene()),
        "a cancelled stage counts as done",
    )


@step("learn (tiny)", "script: the panel's job with smaller settings, which the panel has not")
def learn(story: Story) -> Wait:
    desk.module("tasks.runner").launch(desk.module("steps").learn_scene(desk.scene(), "demo", story.job["tiny"]))
    yield from acts.job_end(story)
    check("geometry" in desk.module("project.contents").finished_stages(desk.scene()), "the scene is not learned")
    yield from story.shoot("learned")
    yield from acts.save_file()


@step("mark", "mouse: name typed, Paint Mask, strokes, Save Mask")
def mark(story: Story) -> Wait:
    karf = desk.scene().karf
    karf.active_view = story.job["masked_view"]
    for name in ("mug", "pot"):
        yield from acts.paint(story, name)
    counts = desk.module("project.contents").mask_counts(desk.scene())
    check(counts == {"mug": 1, "pot": 1}, f"the masks are {counts}")
    yield from acts.save_file()


@step("segment", "mouse: Segment")
def segment(story: Story) -> Wait:
    yield from acts.button_job(story, r"karf\.segment\(")
    check("segmentation" in desk.module("project.contents").finished_stages(desk.scene()), "nothing is segmented")


@step("palette", "mouse: Extract Palette")
def palette(story: Story) -> Wait:
    yield from acts.button_job(story, r"karf\.extract_palette")
    with hands.inside(PICTURE):
        bpy.ops.image.view_all(fit_view=True)
    yield from story.shoot("palette")
    check(set(desk.swatches()) == {"mug", "pot"}, f"the objects are {list(desk.swatches())}")
    check(desk.is_in_step(), "the picture is not what the swatches say")
    story.facts["learned"] = desk.picture()
    yield from acts.save_file()


@step("drag", "mouse: a swatch's picker is opened, its color dragged")
def drag(story: Story) -> Wait:
    before = acts.color_of("pot", 1)
    seen = yield from acts.drag_swatch(story, "pot", 1, 10, (-45, 25))
    yield from story.shoot("dragged")
    story.note(f"{before} became {acts.color_of('pot', 1)}; {seen} pictures on the way")
    check(acts.color_of("pot", 1) != before, "the swatch did not change")
    check(seen >= 4, f"the picture followed only {seen} times")
    check(desk.is_in_step(), "the picture is not what the swatches say")
    story.facts["dragged"] = desk.picture()


@step("undo, redo", "keys: Ctrl Z, Ctrl Shift Z")
def undo(story: Story) -> Wait:
    yield from hands.press("Z", hands.middle_of(VIEW), ctrl=True)
    yield 0.5
    check(desk.picture() == story.facts["learned"], "undo did not bring the picture back")
    check(desk.is_in_step(), "after undo the picture is not what the swatches say")
    yield from hands.press("Z", hands.middle_of(VIEW), ctrl=True, shift=True)
    yield 0.5
    check(desk.picture() == story.facts["dragged"], "redo did not bring the edit back")


@step("keyframe", "keys: I over a swatch, Shift Right, another drag, I; then Left and Right")
def keyframe(story: Story) -> Wait:
    scene = desk.scene()
    scene.frame_start, scene.frame_end = 1, FILM_FRAMES
    scene.frame_set(1)
    yield from acts.key_swatch("mug", 1)
    yield from hands.press("RIGHT_ARROW", hands.middle_of(VIEW), shift=True)
    check(scene.frame_current == FILM_FRAMES, f"Shift Right went to frame {scene.frame_current}")
    yield from acts.drag_swatch(story, "mug", 1, 6, (50, -10))
    yield from acts.key_swatch("mug", 1)
    check(desk.animated_objects() == {"mug"}, f"keyframes are on {desk.animated_objects()}")
    last = desk.picture()
    for _ in range(3):
        yield from hands.press("LEFT_ARROW", hands.middle_of(VIEW))
    yield from story.shoot("keyframed")
    check(scene.frame_current == FILM_FRAMES - 3, f"three times Left went to frame {scene.frame_current}")
    check(desk.picture() != last, "the picture does not follow the frame")
    check(desk.is_in_step(), "the picture is not what the swatches say in this frame")


@step("save again", "keys: Ctrl S")
def save_again(story: Story) -> Wait:
    yield from acts.save_file()


@step("camera's frames", "mouse: Camera's Frames, of three keyframed frames")
def camera_frames(story: Story) -> Wait:
    scene = desk.scene()
    scene.frame_end = 3
    try:
        yield from acts.button_job(story, r"karf\.render_camera")
    finally:
        scene.frame_end = FILM_FRAMES
    written = sorted(
        each.name for each in desk.module("project.folders").out_folder(scene).rglob("recolor/frame_*.png")
    )
    story.note(f"wrote {', '.join(written)}")
    check(len(written) == 3, f"{len(written)} frames were written, not 3")


for _number in (1, 2, 3):
    step(f"render animation {_number}", f"keys: Ctrl F12, {FILM_FRAMES} frames, the result picture open")(
        lambda story, number=_number: acts.render_animation(story, number, FILM_FRAMES)
    )


@step("save elsewhere", "keys: Ctrl Shift S into a folder beside another project of the same name; path by script")
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


@step("reload", "keys: Ctrl O; path by script, button clicked")
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


@step("re-extract with keys", "mouse: a third object, Segment, Extract Palette; Return where Blender asks")
def extract_again(story: Story) -> Wait:
    karf = desk.scene().karf
    karf.active_view = story.job["masked_view"]
    edited = acts.color_of("pot", 1)
    yield from acts.paint(story, "apple")
    yield from acts.button_job(story, r"karf\.segment\(")
    yield from hands.press_button(SIDEBAR, r"karf\.extract_palette")
    yield 0.5
    yield from story.shoot("asked")
    yield from hands.press("RET", hands.middle_of(PICTURE))  # there are edits, and Blender asks first
    yield from until(lambda: desk.module("tasks.runner").is_running(), "the job", 10)
    yield from acts.job_end(story)
    yield from story.shoot("extracted-again")
    check(set(desk.swatches()) == {"apple", "mug", "pot"}, f"the objects are {list(desk.swatches())}")
    check(desk.animated_objects() == {"mug"}, f"the mug's keyframes went to {desk.animated_objects() or 'nobody'}")
    desk.scene().frame_set(1)
    first = desk.picture()
    desk.scene().frame_set(FILM_FRAMES)
    check(desk.picture() != first, "the keyframed picture does not follow any more")
    check(acts.color_of("pot", 1) == edited, f"the pot's edit {edited} became {acts.color_of('pot', 1)}")


@step("disable, enable", "script: the extension is switched off and on")
def disable_enable(story: Story) -> Wait:
    before = desk.swatches()
    bpy.ops.preferences.addon_disable(module=desk.PACKAGE)
    yield 1.0
    left = remains.remains(desk.PACKAGE)
    yield from story.shoot("disabled")
    bpy.ops.preferences.addon_enable(module=desk.PACKAGE)
    yield 1.0
    yield from acts.show_tab()
    check(not left, f"a disabled extension leaves {left}")
    check(desk.swatches() == before, "the swatches are others after disabling and enabling")
    learned = desk.picture()
    yield from acts.drag_swatch(story, "pot", 1, 6, (-30, -30))
    yield from story.shoot("enabled")
    check(desk.picture() != learned and desk.is_in_step(), "swatches have no effect after enabling again")
