"""The story's second half: swatches, looks, keyframes, files, the extension switched off and on. Runs inside Blender."""

from __future__ import annotations

from pathlib import Path

import bpy
from mathutils import Matrix

from . import acts, controls, desk, hands
from .desk import MARKED_VIEW, PHOTO_SIZE, check
from .hands import BESIDE_PICTURE, PICTURE, SIDEBAR, VIEW, Wait
from .record import Chapter, Story
from .remains import remains

CHAPTER = Chapter()
FILM_FRAMES = 60


# --- swatches --------------------------------------------------------------------------------------------------------
@CHAPTER.step("mouse: a swatch's picker is opened, its color dragged; keys: Ctrl Z, Ctrl Shift Z")
def drag_undo_redo(story: Story) -> Wait:
    """The picture follows a dragged swatch; undo and redo bring the very pixels back."""
    colors, learned = desk.swatches(), desk.picture()
    n_pictures = yield from controls.drag_swatch((-45, 25))
    dragged = desk.picture()
    yield from story.shoot()
    story.note(f"{colors[1]} became {desk.swatches()[1]}; {n_pictures} pictures on the way")
    check(n_pictures >= 4, f"the picture followed only {n_pictures} times")
    check(dragged != learned and desk.is_in_step(), "the picture is not what the swatches say")
    yield from acts.undo()
    check(desk.picture() == learned, "undo did not bring the picture back")
    check(desk.swatches() == colors, "undo did not bring the swatches back")
    yield from acts.undo(shift=True)
    check(desk.picture() == dragged and desk.is_in_step(), "redo did not bring the edit back")


@CHAPTER.step("mouse: the eyedropper, a click on the object under the loupe; keys: Ctrl Z")
def add_a_color(story: Story) -> Wait:
    """A color that is picked under the loupe is another swatch, changes nothing by itself, and can be undone."""
    colors, picture = desk.swatches(), desk.pixels()
    yield from controls.press_button(BESIDE_PICTURE, r"karf\.add_color\(")
    place = hands.in_picture(*desk.middle_of_object())
    yield from hands.move(place)
    yield from story.shoot("loupe")
    yield from hands.click(place)
    yield from story.shoot()
    story.note(f"{len(colors)} swatches became {len(desk.swatches())}")
    check(len(desk.swatches()) > len(colors), "no color was added")
    # its weights are those of the swatches, divided: a byte may be rounded otherwise
    check(desk.difference(desk.pixels(), picture).max() <= 1, "a color that is added changes the picture")
    yield from acts.undo()
    check(desk.swatches() == colors, "undo left the added color")


@CHAPTER.step("mouse: Keep Look, a swatch dragged, Keep Look, the first look chosen; keys: V over the picture, Ctrl Z")
def keep_and_flip_looks(story: Story) -> Wait:
    """A kept look brings its very picture back; V flips to the other, and undo flips back."""
    first = desk.picture()
    yield from controls.press_button(BESIDE_PICTURE, r"karf\.keep_look\(")
    yield from controls.drag_swatch((40, -35))
    second = desk.picture()
    yield from controls.press_button(BESIDE_PICTURE, r"karf\.keep_look\(\)")
    names = desk.scene().karf.looks.keys()
    check(names == ["A", "B"] and first != second, f"the looks are {names}")
    yield from story.shoot()
    yield from controls.press_button(BESIDE_PICTURE, r'karf\.choose_look\(name="A"\)')
    check(desk.picture() == first and desk.is_in_step(), "the first look does not bring its picture")
    yield from hands.press("V", hands.middle_of(PICTURE))
    check(desk.picture() == second and desk.scene().karf.look == "B", "V does not flip to the other look")
    yield from acts.undo()
    check(desk.picture() == first and desk.scene().karf.look == "A", "undo does not flip back")


@CHAPTER.step("keys: I over a swatch, Shift Right, I after another drag, Left")
def keyframe(story: Story) -> Wait:
    """A swatch is keyframed as any property, and the picture follows the frame."""
    scene = desk.scene()
    scene.frame_start, scene.frame_end = 1, FILM_FRAMES
    scene.frame_set(1)
    yield from hands.press("I", (yield from controls.find_swatch()))
    yield from hands.press("RIGHT_ARROW", hands.middle_of(VIEW), shift=True)
    check(scene.frame_current == FILM_FRAMES, f"Shift Right went to frame {scene.frame_current}")
    yield from controls.drag_swatch((50, -10))
    yield from hands.press("I", (yield from controls.find_swatch()))
    frames = {frame for _, frame, _ in desk.keyframes()}
    check(frames == {1, FILM_FRAMES}, f"keyframes are {desk.keyframes()}")
    last = desk.picture()
    for _ in range(3):
        yield from hands.press("LEFT_ARROW", hands.middle_of(VIEW))
    yield from story.shoot()
    check(scene.frame_current == FILM_FRAMES - 3, f"three times Left went to frame {scene.frame_current}")
    check(desk.picture() != last and desk.is_in_step(), "the picture does not follow the frame")


# --- what must last --------------------------------------------------------------------------------------------------
@CHAPTER.step("keys: Ctrl Shift S into another folder, Ctrl O; paths by script, buttons clicked")
def save_and_reload(story: Story) -> Wait:
    """Saved elsewhere and loaded again, swatches, looks, keyframes, project and pixels are the same."""
    saved, blend = state(), story.desk / "sub" / "story.blend"
    yield from acts.save_file_as(blend)
    compare(saved, "saving elsewhere")
    yield from hands.press("O", hands.middle_of(VIEW), ctrl=True)
    yield from acts.choose_file(blend)
    yield 2.0
    yield from acts.show_tab()
    yield from story.shoot()
    compare(saved, "loading")
    check(desk.is_in_step(), "the picture is not what the swatches say")
    displayed = hands.area_of("IMAGE_EDITOR").spaces.active.image
    check(displayed == desk.scene().karf.result, f"the Image Editor shows {displayed and displayed.name}")
    dirty = [image.name for image in bpy.data.images if image.is_dirty]
    check(not dirty, f"Blender would ask whether to save {dirty}")


def state() -> dict[str, object]:
    """Return everything that must outlast a session."""
    scene = desk.scene()
    return {
        "swatches": desk.swatches(),
        "looks": scene.karf.looks.keys(),
        "keyframes": desk.keyframes(),
        "frame": scene.frame_current,
        "project": desk.module("project.folders").project_of(scene).folder,
        "picture": desk.picture(),
    }


def compare(before: dict[str, object], event: str) -> None:
    """Raise Broken if the state has changed."""
    after = state()
    for what, value in before.items():
        check(after[what] == value, f"{event} changed the {what}: {value} became {after[what]}")


# --- pictures as files -----------------------------------------------------------------------------------------------
@CHAPTER.step("script: step 5 is opened, names of views; mouse: Captured Views; keys: Return in its dialog")
def recolor_photos(story: Story) -> Wait:
    """Photos are written recolored, in their own sizes, and pixels of the object alone change."""
    manager, scene = bpy.data.window_managers[0], desk.scene()
    views = [MARKED_VIEW, *(view.name for view in scene.karf.views[:4])]
    scene.frame_set(1)
    manager.karf_folding.show_render = True
    manager.operator_properties_last("karf.render_capture").views = ",".join(views)
    yield from acts.show_tab()
    yield from acts.dialog_job(story, r"karf\.render_capture")
    written = sorted(recolored("").glob("*.png"))
    check(sorted(views) == [file.stem for file in written], f"written were {written}")
    for view in views:
        photo = desk.module("project.captures").view_of(scene, view).image
        own, other = desk.pixels_of(photo), desk.pixels_of(recolored(f"{view}.png"))
        check(own.shape == other.shape, f"{view} has {other.shape}, its photo {own.shape}")
        share = float((desk.difference(own, other).max(-1) > 8).mean())
        story.note(f"{share:.0%} of the pixels of {view} changed")
        check(0.01 < share < 0.5, "too few or too many pixels changed")


def recolored(name: str) -> Path:
    """Return the file of a picture of the swatches."""
    scene = desk.scene()
    look = desk.module("swatches.outputs").look_of(scene)
    return desk.module("project.folders").out_folder(scene) / desk.module("swatches.outputs").folder_name(look) / name


@CHAPTER.step("script: a camera beside a photo's, one frame; mouse: Camera's Frames; keys: Return in its dialog")
def render_new_camera(story: Story) -> Wait:
    """A camera that no photo was taken with renders the recolored scene, in the size of the render settings."""
    scene = desk.scene()
    scene.camera = new_camera(scene)
    scene.render.resolution_x = scene.render.resolution_y = PHOTO_SIZE
    scene.frame_end = scene.frame_start
    try:
        yield from acts.dialog_job(story, r"karf\.render_camera")
    finally:
        scene.frame_end = FILM_FRAMES
    yield from story.shoot()
    photos = recolored("")  # the folder of the look
    files = sorted(photos.parent.glob(f"cameras/*/{photos.name}/frame_*.png"))
    check(len(files) == 1, f"{len(files)} frames were written, not one")
    frame, beside = desk.pixels_of(files[0]), desk.pixels_of(recolored(f"{MARKED_VIEW}.png"))
    check(frame.shape == beside.shape, f"the frame has {frame.shape}, and not {beside.shape}")
    mean = float(desk.difference(frame, beside).mean())
    story.note(f"{files[0].relative_to(story.desk)} is {mean:.1f} of 255 from the recolored photo beside it")
    check(1 < mean < 40, "the frame is the photo, or not of its scene")


def new_camera(scene: bpy.types.Scene) -> bpy.types.Object:
    """Return a new camera beside that of the marked view."""
    beside = desk.module("rig.cameras").camera_of(scene, MARKED_VIEW)
    camera = bpy.data.objects.new("new", bpy.data.cameras.new("new"))
    camera.data.angle = beside.data.angle
    camera.matrix_world = beside.matrix_world @ Matrix.Translation((beside.matrix_world.translation.length / 20, 0, 0))
    scene.collection.objects.link(camera)
    return camera


@CHAPTER.step("script: a view's name; mouse: All Looks; keys: Return in its dialog")
def render_looks(story: Story) -> Wait:
    """Two looks are two folders, with pictures that differ."""
    bpy.data.window_managers[0].operator_properties_last("karf.render_looks").views = MARKED_VIEW
    yield from acts.dialog_job(story, r"karf\.render_looks")
    out = desk.module("project.folders").out_folder(desk.scene())
    first, second = (desk.pixels_of(out / look / f"{MARKED_VIEW}.png") for look in "AB")
    check((first != second).any(), "both looks have the same picture")


@CHAPTER.step("mouse: Learn Splats; script: Export Page, its values; keys: Return in its dialog")
def export_page(story: Story) -> Wait:
    """The scene with its looks becomes a web page of one file, which a browser then opens."""
    if "splats" not in desk.stages():
        yield from acts.press_job(r"karf\.learn_splats")
    page = story.desk / "page"
    with hands.inside(VIEW):
        bpy.ops.karf.export_page("INVOKE_DEFAULT", directory=str(page), title="Pots", single=True)
    yield 0.5
    yield from story.shoot("dialog")
    yield from acts.begin_job(hands.press("RET", hands.middle_of(VIEW)))
    yield from acts.end_job()
    story.note(f"{(page / 'index.html').stat().st_size / 1e6:.1f} MB")


@CHAPTER.step("mouse: Add Delete Box, Delete Inside, Restore All")
def delete_floaters(story: Story) -> Wait:
    """A box deletes the splats in it, and they can be brought back."""
    yield from controls.press_button(SIDEBAR, r"karf\.add_delete_box")
    yield from story.shoot("box")
    for operator, is_deleted in ((r"karf\.delete_inside", True), (r"karf\.restore_splats", False)):
        yield from acts.press_job(operator)
        yield from story.shoot(operator.rpartition(".")[2])
        n_deleted = desk.module("project.disk").read(desk.scene()).erased
        story.note(f"{n_deleted:,} splats are deleted")
        check((n_deleted > 0) == is_deleted, f"{n_deleted} splats are deleted")
    check(desk.scene().objects.get("KaRF Delete Box") is None, "the box is still there")


@CHAPTER.step("mouse: Look Through, Rendered View; script: solid shading")
def rendered_view(story: Story) -> Wait:
    """The rendered 3D View shows the recolored scene and no photo over it, also through a captured camera."""
    space, scene = hands.area_of("VIEW_3D").spaces.active, desk.scene()
    with hands.inside(VIEW):
        bpy.ops.karf.look_through()
    yield from controls.press_button(SIDEBAR, r"karf\.rendered_view")
    yield 10.0
    yield from story.shoot()
    check(space.shading.type == "RENDERED" and space.region_3d.view_perspective == "CAMERA", "the view is another")
    check(not scene.camera.data.show_background_images, "the photo lies over the picture")
    space.shading.type = "SOLID"
    yield 1.0
    check(scene.camera.data.show_background_images, "the photo did not come back")


@CHAPTER.step("script: the extension is switched off and on; mouse: a swatch is dragged")
def disable_and_enable(story: Story) -> Wait:
    """A disabled extension leaves no handler, timer, drawing callback, class or property; enabled again, it works."""
    colors = desk.swatches()
    bpy.ops.preferences.addon_disable(module=desk.PACKAGE)
    yield 1.0
    left = remains(desk.PACKAGE)
    yield from story.shoot("disabled")
    bpy.ops.preferences.addon_enable(module=desk.PACKAGE)
    acts.choose_engine(story.job)  # Blender forgets an extension's preferences
    yield 1.0
    yield from acts.show_tab()
    check(not left, f"a disabled extension leaves {left}")
    check(desk.swatches() == colors, "the swatches are others than before")
    before = desk.picture()
    yield from controls.drag_swatch((-30, -30))
    yield from story.shoot("enabled")
    check(desk.picture() != before and desk.is_in_step(), "the picture does not follow a swatch any more")
