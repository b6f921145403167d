"""Step 7: photos and frames as files, back in Blender, in colorways and in the compositor. Runs inside Blender."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from . import acts, desk, hands
from .acts import FILM_FRAMES, PICTURE, STEPS, Story, check
from .hands import Wait, Where
from .telling import Chapter

CHAPTER = Chapter()
SHEET = "colorway,object,hex\nspring,pot,#3a7d44\nspring,mug,#f4d35e\nautumn,pot,#8c3b1a\n"
NEAR = 2  # steps of 255 between the engine's picture and the compositor's


@CHAPTER.step(
    "this view",
    "mouse: This View and its dialog, at the photo's size, then with a long side of 128 pixels, set by script",
)
def this_view(story: Story) -> Wait:
    karf = desk.scene().karf
    photo = desk.pixels_of(desk.photo_of(karf.active_view))
    yield from acts.open_step("render")
    yield from acts.dialog_job(story, r"karf\.render_view")
    yield from story.shoot("this-view")
    written = desk.pixels_of(_recolored(karf.active_view))
    check(written.shape == photo.shape, f"the picture has {written.shape}, its photo {photo.shape}")
    changed = float((written != photo).any(-1).mean())
    story.note(f"{changed:.0%} of the photo's pixels changed")
    check(0.0 < changed < 0.5, "the edit changed no pixel of the photo, or most of them")
    karf.captured_size, karf.captured_pixels = "PIXELS", 128
    yield from acts.dialog_job(story, r"karf\.render_view")
    yield from story.shoot("long-side")
    karf.captured_size = "PHOTO"
    written = desk.pixels_of(_recolored(karf.active_view))
    check(max(written.shape) == 128, f"the picture has {written.shape}, and not a long side of 128")


@CHAPTER.step("captured views", "mouse: Captured Views and its dialog, at the photos' size")
def captured_views(story: Story) -> Wait:
    yield from acts.dialog_job(story, r"karf\.render_capture")
    yield from story.shoot("captured-views")
    views = [view.name for view in desk.scene().karf.views]
    for name in views:
        written, photo = (desk.pixels_of(file) for file in (_recolored(name), desk.photo_of(name)))
        check(written.shape == photo.shape, f"the picture of {name} has {written.shape}, its photo {photo.shape}")
    story.note(f"{len(views)} pictures of the size of their photos")


@CHAPTER.step("skip existing", "mouse: Captured Views again, from which one picture was deleted")
def skip_existing(story: Story) -> Wait:
    views = [view.name for view in desk.scene().karf.views]
    _recolored(views[0]).unlink(missing_ok=True)
    before = {name: _recolored(name).stat().st_mtime_ns for name in views[1:]}
    yield from acts.dialog_job(story, r"karf\.render_capture")
    after = {name: _recolored(name).stat().st_mtime_ns for name in views[1:]}
    check(_recolored(views[0]).exists(), f"{views[0]} was not rendered again")
    check(before == after, f"{sum(before[name] != after[name] for name in before)} pictures were rendered again")


def _recolored(view: str) -> Path:
    return desk.output() / "recolor" / f"{view}.png"


@CHAPTER.step("camera's frames", "mouse: Camera's Frames and its dialog, of three keyframed frames")
def camera_frames(story: Story) -> Wait:
    scene = desk.scene()
    scene.frame_end = 3
    try:
        yield from acts.dialog_job(story, r"karf\.render_camera")
    finally:
        scene.frame_end = FILM_FRAMES
    written = sorted(each.name for each in desk.output().rglob("recolor/frame_*.png"))
    story.note(f"wrote {', '.join(written)}")
    check(len(written) == 3, f"{len(written)} frames were written, not 3")


@CHAPTER.step("show frames", "mouse: a group is opened, Show Frames; script: the picture is looked at before")
def show_frames(story: Story) -> Wait:
    editor = hands.area_of("IMAGE_EDITOR").spaces.active
    editor.image = desk.scene().karf.result
    yield from acts.open_group(r"karf\.show_frames")
    yield from hands.press_button(STEPS, r"karf\.show_frames")
    yield from story.shoot("frames")
    check(editor.image.source == "SEQUENCE", f"the Image Editor shows {editor.image.name}, {editor.image.source}")
    user = editor.image_user
    check((user.frame_start, user.frame_duration) == (1, 3), f"{user.frame_duration} frames from {user.frame_start}")


@CHAPTER.step("add strip", "mouse: Add Strip; script: the 3D View becomes a sequencer for a look")
def add_strip(story: Story) -> Wait:
    scene, compat = desk.scene(), desk.module("host.compat")
    yield from hands.press_button(STEPS, r"karf\.add_strip", 0.68)
    (strip,) = compat.strips_of(scene)
    shown = getattr(hands.window().workspace, "sequencer_scene", scene)  # before 5.0 the window's
    check(shown == scene, "the sequencer does not show the scene that has the strip")
    check(compat.strip_range(strip) == (1, 4), f"the strip covers {compat.strip_range(strip)}")
    frame, area = scene.frame_current, hands.area_of("VIEW_3D")
    scene.frame_set(2)
    area.ui_type = "SEQUENCE_EDITOR"
    area.spaces.active.view_type = "SEQUENCER_PREVIEW"
    yield 1.0
    with hands.inside(Where("SEQUENCE_EDITOR", "WINDOW")):
        bpy.ops.sequencer.view_all()
    yield 1.0
    yield from story.shoot("strip")
    area.ui_type = "VIEW_3D"
    compat.strips_of(scene).remove(strip)  # else it is what Blender renders
    scene.frame_set(frame)
    yield from acts.set_up_screen()
    yield from acts.show_tab()


@CHAPTER.step(
    "colorways", "mouse: a group is opened, Colorways, Cancel; Return in the dialog; script: path, then a single view"
)
def colorways(story: Story) -> Wait:
    manager, view, sheet = bpy.data.window_managers[0], story.job["masked_view"], story.desk / "catalog.csv"
    sheet.write_text(SHEET)
    yield from acts.open_group(r"karf\.colorways")
    yield from hands.press_button(STEPS, r"karf\.colorways")
    yield from acts.file_browser(story.desk, sheet.name)
    yield 0.5
    yield from story.shoot("colorways")
    check(len(manager.karf_colorways.colors) == 3, f"the dialog lists {len(manager.karf_colorways.colors)} colors")
    yield from acts.job_begin(hands.press("RET", hands.middle_of(PICTURE)), "karf.render_colorways")
    yield from hands.press_button(STEPS, r"karf\.cancel", hands.RIGHT)
    yield from acts.job_end(story, "cancelled")
    with hands.inside(STEPS):
        bpy.ops.karf.render_colorways(filepath=str(sheet), views=view)
    yield from acts.job_end(story)
    yield from story.shoot("colorways-written")
    folder = desk.output() / "colorways" / sheet.stem
    pictures, others = list(folder.glob(f"*/{view}.png")), [file.name for file in folder.iterdir() if file.is_file()]
    story.note(f"wrote {len(pictures)} pictures of {view}, {', '.join(sorted(others))}")
    check(len(pictures) == 2, f"{len(pictures)} pictures of {view} were written, not 2")


@CHAPTER.step("render looks", "mouse: Render Looks; keys: Esc in its dialog; script: a single view")
def render_looks(story: Story) -> Wait:
    view = story.job["masked_view"]
    yield from hands.press_button(STEPS, r"karf\.render_looks")
    yield 0.5
    yield from story.shoot("dialog-render_looks")
    yield from hands.press("ESC", hands.middle_of(PICTURE))
    with hands.inside(STEPS):
        bpy.ops.karf.render_looks(views=view)
    yield from acts.job_end(story)
    folder = desk.module("steps").looks_folder(desk.scene())
    pictures = {file.parent.name: desk.pixels_of(file) for file in sorted(folder.glob(f"*/{view}.png"))}
    check(list(pictures) == ["A", "B"], f"there are pictures of the looks {list(pictures)}")
    check(bool((pictures["A"] != pictures["B"]).any()), "the looks were rendered alike")


for _number in (1, 2, 3):
    CHAPTER.step(f"render animation {_number}", f"keys: Ctrl F12, {FILM_FRAMES} frames, the result picture open")(
        lambda story, number=_number: acts.render_animation(story, number, FILM_FRAMES)
    )


@CHAPTER.step(
    "compositor", "mouse: a group is opened, Build, Follow Swatches; keys: F12; script: render settings, a swatch"
)
def compositor(story: Story) -> Wait:
    scene, view = desk.scene(), story.job["masked_view"]
    scene.karf.active_view = view
    yield from acts.dialog_job(story, r"karf\.render_view")
    engine = desk.pixels_of(_recolored(view))
    height, width, _ = engine.shape
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    scene.view_settings.view_transform = "Standard"
    yield from acts.open_group(r"karf\.build_compositor")
    yield from acts.button_job(story, r"karf\.build_compositor\(driven=True\)")
    yield from story.shoot("compositor-built")
    yield from acts.render_image(story.desk / "composite_1.png")
    first = desk.pixels_of(story.desk / "composite_1.png")
    difference = int(np.abs(first - engine).max())
    story.note(f"at most {difference} of 255 between the compositor and the engine")
    check(difference <= NEAR, f"the compositor's picture is {difference} of 255 off the engine's")
    swatch = scene.karf.objects["pot"].swatches[1]
    before = tuple(swatch.color)
    swatch.color = (0.1, 0.6, 0.9)
    area = hands.area_of("VIEW_3D")
    area.ui_type = "CompositorNodeTree"
    yield 0.5
    with hands.inside(Where("NODE_EDITOR", "WINDOW")):
        bpy.ops.node.view_all()
    yield from acts.render_image(story.desk / "composite_2.png")
    yield from story.shoot("compositor-swatch")
    area.ui_type = "VIEW_3D"
    swatch.color = before
    second = desk.pixels_of(story.desk / "composite_2.png")
    check(bool((np.abs(second - first).max(-1) > 20).mean() > 0.005), "the composite did not follow the swatch")
    yield from acts.set_up_screen()
    yield from acts.show_tab()
