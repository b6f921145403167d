"""From a capture to swatches: installation, import, learning, masks, palette. Runs inside Blender."""

from __future__ import annotations

from pathlib import Path

import bpy

from . import acts, desk, hands, remains
from .acts import BESIDE_PICTURE, JOB_SECONDS, PICTURE, STEPS, TAB, VIEW, Story, check, until
from .hands import Wait, Where
from .telling import Chapter

CHAPTER = Chapter()
CHECK_SECONDS = 300.0  # in which a busy machine has looked at the demo's photos
SPACE, MISTYPED = "ACEScg", "ACESgc"


@CHAPTER.step("install", "script: Install from Disk, the engine's Python in the preferences")
def install(story: Story) -> Wait:
    # the sidebar beside the picture, not over it, where strokes would hit it
    bpy.context.preferences.system.use_region_overlap = False
    yield from acts.install(story)
    held = remains.remains(desk.PACKAGE)
    for kind in ("handler", "drawing", "class", "property"):
        check(any(line.startswith(kind) for line in held), f"no {kind} of the extension is found: the check is blind")
    story.note(f"the extension holds {len(held)} things in Blender")
    bpy.ops.wm.save_userpref()


@CHAPTER.step("test engine", "script: the preferences' buttons: Test Engine, its cross, Test Engine, Copy Report")
def test_engine(story: Story) -> Wait:
    probing, python = desk.module("engine.probing"), Path(story.job["engine_python"])
    bpy.ops.karf.examine_engine()
    yield from until(lambda: probing.findings_on(python), "a finding", 120)
    bpy.ops.karf.cancel_examination()
    check(not probing.is_running() and not probing.findings_on(python), "a cancelled test goes on")
    bpy.ops.karf.examine_engine()
    yield from until(lambda: probing.verdict_on(python) is not None, "Test Engine's verdict", JOB_SECONDS)
    verdict = probing.verdict_on(python)
    story.note(verdict.sentence)
    check(verdict.exit_code == 0, f"Test Engine says {verdict.sentence!r}")
    names = {finding.name for finding in probing.findings_on(python)}
    check({"geometry", "segmentation", "palette", "recoloring", "render"} <= names, f"tried was only {names}")
    bpy.ops.karf.copy_findings()
    report = bpy.context.window_manager.clipboard
    check(verdict.sentence in report, "the report lacks the verdict")
    check(str(Path.home()) not in report, "the report has the user's folder")


@CHAPTER.step("sidebar", "keys: Esc closes the splash screen; script: editors and sidebars are opened")
def sidebar(story: Story) -> Wait:
    yield from hands.press("ESC", hands.middle_of(VIEW))  # a first start's splash screen takes the next key
    yield from acts.set_up_screen()
    first = {kind: hands.region_of(Where(kind)).active_panel_category for kind in ("VIEW_3D", "IMAGE_EDITOR")}
    yield from acts.show_tab()
    yield from story.shoot("sidebar")
    check(TAB not in first.values(), f"{TAB} takes the place of the first tab: {first}")


@CHAPTER.step("save", "keys: Ctrl Shift S; path by script, button clicked")
def save(story: Story) -> Wait:
    yield from acts.save_file_as(story.home / "story.blend")
    story.facts["blend"] = bpy.data.filepath


@CHAPTER.step("import", "mouse: Import Capture; path by script, button clicked")
def import_capture(story: Story) -> Wait:
    yield from hands.press_button(STEPS, r"karf\.import_capture")
    yield from acts.file_browser(story.desk / "pots")
    karf = desk.scene().karf
    story.note(f"{len(karf.views)} views, project {karf.project}")
    yield from story.shoot("import")
    check(len(karf.views) == story.job["views"], f"{len(karf.views)} views, not {story.job['views']}")
    check(karf.project == "//pots_karf", f"the project is {karf.project!r}")
    yield from acts.save_file()


@CHAPTER.step("check capture", "script: step 1 is opened; mouse: Check Capture")
def check_capture(story: Story) -> Wait:
    karf, queries, name = desk.scene().karf, desk.module("tasks.queries"), desk.module("steps.capture").MAP_NAME
    yield from until(lambda: not queries.is_waiting("inspect"), "the check that an import begins", CHECK_SECONDS)
    karf.advice = ""
    yield from acts.open_step("import")
    yield from hands.press_button(STEPS, r"karf\.check_capture")
    yield from story.shoot("checking")
    yield from until(lambda: bool(karf.advice), "the engine's advice", CHECK_SECONDS)
    yield 0.5
    yield from story.shoot("checked")
    story.note(karf.advice.splitlines()[0])
    picture = hands.area_of("IMAGE_EDITOR").spaces.active.image
    check(picture is not None and picture.name == name, "the map of what to shoot more is not shown")
    check(not karf.is_poor, "the demo's capture is called poor")


@CHAPTER.step(
    "color space",
    "script: steps 1 and 2 are opened; mouse: Advanced, Learn Scene; keys: a color space's name, mistyped, then typed",
)
def color_space(story: Story) -> Wait:
    karf, progress = desk.scene().karf, bpy.data.window_managers[0].karf_progress
    project = r"\.karf\.project"
    yield from acts.open_step("import")
    yield from acts.open_step("learn")
    x, y = yield from hands.edge(STEPS, project, (yield from hands.find(STEPS, project, 0.57)), (0, -4))
    yield from hands.click((x, y - hands.ROW))
    field = yield from hands.find(STEPS, r"karf\.photo_space", 0.68)
    yield from hands.write(MISTYPED, field)
    check(karf.photo_space == MISTYPED, f"typed {MISTYPED}, got {karf.photo_space!r}")
    yield from acts.job_begin(hands.press_button(STEPS, r"karf\.learn_scene"), "Learn Scene")
    yield from until(lambda: not desk.module("tasks.runner").is_running(), "the job's end", JOB_SECONDS)
    yield from story.shoot("color-space-mistyped")
    story.note(progress.error)
    check(MISTYPED in progress.error, f"a color space that there is not leads to {progress.error!r}")
    yield from hands.write(SPACE, (yield from hands.find(STEPS, r"karf\.photo_space", 0.68)))
    yield from story.shoot("color-space")
    check(karf.photo_space == SPACE, f"typed {SPACE}, got {karf.photo_space!r}")
    karf.photo_space = ""  # the demo's photos are sRGB
    yield from hands.click((x, y - hands.ROW))


@CHAPTER.step("learn, cancel", "mouse: Learn Scene with the preset, then the cross")
def learn_cancel(story: Story) -> Wait:
    yield from hands.press_button(STEPS, r"karf\.learn_scene")
    progress = bpy.data.window_managers[0].karf_progress
    yield from until(lambda: progress.fraction > 0, "progress", JOB_SECONDS)
    check(any("timer" in line for line in remains.remains(desk.PACKAGE)), "no timer is found: the check is blind")
    yield from story.shoot("learning")
    yield from hands.press_button(STEPS, r"karf\.cancel", hands.RIGHT)
    yield from acts.job_end(story, "cancelled")
    check(
        "geometry" not in desk.module("project.disk").read(desk.scene()).stages,
        "a cancelled stage counts as done",
    )


@CHAPTER.step("learn (tiny)", "script: the panel's job with smaller settings, which the panel has not")
def learn(story: Story) -> Wait:
    desk.module("tasks.runner").launch(desk.module("steps").learn_scene(desk.scene(), "demo", story.job["tiny"]))
    yield from acts.job_end(story)
    check("geometry" in desk.module("project.disk").read(desk.scene()).stages, "the scene is not learned")
    yield from story.shoot("learned")
    yield from acts.save_file()


@CHAPTER.step("mark", "mouse: Mark in Photo, names typed, brush from the toolbar; keys: Ctrl Z, Page Down")
def mark(story: Story) -> Wait:
    karf = desk.scene().karf
    karf.active_view = story.job["masked_view"]
    yield from hands.press_button(BESIDE_PICTURE, r"karf\.mark\(")
    with hands.inside(PICTURE):
        bpy.ops.image.view_all(fit_view=True)
    yield 0.5
    yield from acts.mark(story, 0, "mug")
    yield from hands.press_button(BESIDE_PICTURE, r"karf\.add_object", hands.RIGHT)
    yield from acts.mark(story, 1, "pot")
    counts = desk.module("project.disk").read(desk.scene()).masks
    check(counts == {"mug": 1, "pot": 1}, f"the masks are {counts}")
    yield from undo_a_stroke(story)
    yield from acts.save_file()


def undo_a_stroke(story: Story) -> Wait:
    """A stroke too many is undone; the mask is there again when its view is."""
    before = desk.mask("pot")
    yield from hands.drag([acts.on_photo(0.1, 0.9), acts.on_photo(0.3, 0.9)])
    check(desk.mask("pot") != before, "the brush does not paint")
    yield from hands.press("Z", hands.middle_of(PICTURE), ctrl=True)
    check(desk.mask("pot") == before, "undo does not take the stroke back")
    view = desk.scene().karf.active_view
    yield from hands.press("PAGE_DOWN", hands.middle_of(PICTURE))
    check(desk.scene().karf.active_view != view, "Page Down shows no other view")
    yield from hands.press("PAGE_UP", hands.middle_of(PICTURE))
    check(desk.scene().karf.active_view == view, "Page Up does not lead back")
    yield from story.shoot("marked-reopened")


@CHAPTER.step("segment", "mouse: Segment")
def segment(story: Story) -> Wait:
    yield from acts.button_job(story, r"karf\.segment\(")
    check("segmentation" in desk.module("project.disk").read(desk.scene()).stages, "nothing is segmented")


@CHAPTER.step("palette", "mouse: Extract Palette")
def palette(story: Story) -> Wait:
    yield from acts.button_job(story, r"karf\.extract_palette")
    with hands.inside(PICTURE):
        bpy.ops.image.view_all(fit_view=True)
    yield from story.shoot("palette")
    check(set(desk.swatches()) == {"mug", "pot"}, f"the objects are {list(desk.swatches())}")
    check(desk.is_in_step(), "the picture is not what the swatches say")
    story.facts["learned"] = desk.picture()
    yield from acts.save_file()
