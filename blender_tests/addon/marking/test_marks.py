"""Marks on photos: the masks they write, corrections, undo, and the marked objects and views."""

import numpy as np
import pytest

from blender_tests.engine.reference.no_files import NO_FILES

SHAPE = 16, 24
ROWS, COLUMNS = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]] + 0.5


@pytest.fixture
def marked(bpy, addon, project_scene):
    """The scene with a photo to mark and an object `pot`, after an undo step."""
    addon.steps.add_object(project_scene, "pot")
    addon.steps.show_photo(project_scene)
    bpy.ops.ed.undo_push(message="begin")
    return project_scene


def file_of(addon, scene, name="pot", view="photo_0"):
    return addon.objects.masks_folder(scene) / name / f"{view}.png"


def mask(addon, scene, **place):
    """The mask in its file, or None without a file."""
    file = file_of(addon, scene, **place)
    return addon.images.read_mask(file) if file.exists() else None


def disc(x, y, radius):
    return np.hypot(COLUMNS - x, ROWS - y) <= radius


def near(x, y):
    """The fake engine's mask for a click."""
    return np.hypot(COLUMNS - x, ROWS - y) < 3


def write_disc(addon, path):
    addon.images.write_png(path, disc(8, 8, 5)[..., None].repeat(3, -1))


BOX = (COLUMNS > 3.4) & (COLUMNS < 20.5) & (ROWS > 2.6) & (ROWS < 12.4)
LASSO = (COLUMNS > 2) & (ROWS - 2 > (COLUMNS - 2) * 6 / 18) & (14 - ROWS > (COLUMNS - 2) * 6 / 18)
DENTED = (ROWS < 8) | (COLUMNS < 8) | (COLUMNS > 16)
DENT = [(0, 0), (24, 0), (24, 16), (16, 16), (16, 8), (8, 8), (8, 16), (0, 16)]
LINE = np.hypot(COLUMNS - 5.2, np.maximum(0, np.maximum(5 - ROWS, ROWS - 9))) <= 2.5
PAINTED = disc(8, 8, 6) | near(20, 8)
# name: gestures, each with the resulting mask
GESTURES = {
    "strokes": [
        (("mark_stroke", [(5, 5)], 3), disc(5, 5, 3)),
        (("mark_stroke", [(15.2, 7.7)], 4.5), disc(5, 5, 3) | disc(15.2, 7.7, 4.5)),
    ],
    "brush, lasso and eraser": [
        (("mark_stroke", [(5.2, 5), (5.2, 9)], 2.5), LINE),
        (("mark_stroke", [(5, 5)], 30, "TAKE"), None),
        (("mark_lasso", [(2, 2), (20, 8), (2, 14)]), LASSO),
        (("mark_lasso", DENT), DENTED | LASSO),
        (("mark_stroke", [(15, 7)], 2, "TAKE"), (DENTED | LASSO) & ~disc(15, 7, 2)),
    ],
    "erased": [(("mark_stroke", [(5, 5)], 3), disc(5, 5, 3)), (("erase_mask",), None)],
    "box and click": [
        (("mark_box", (20.5, 12.4), (3.4, 2.6)), BOX),
        (("mark_click", (6, 6), "TAKE"), BOX & ~near(6, 6)),
    ],
    "clicks": [(("mark_click", (6, 6)), near(6, 6)), (("mark_click", (16, 6)), near(6, 6) | near(16, 6))],
    "clicks on what was painted": [
        (("mark_stroke", [(8, 8)], 6), disc(8, 8, 6)),
        (("mark_click", (20, 8)), PAINTED),
        (("mark_stroke", [(1, 1)], 1), PAINTED | disc(1, 1, 1)),
        (("mark_click", (8, 8), "TAKE"), (PAINTED | disc(1, 1, 1)) & ~near(8, 8)),
    ],
}


@pytest.mark.parametrize("gestures", GESTURES)
def test_gestures_write_these_masks_and_undo_reverts_them(bpy, addon, marked, gestures):
    def assert_mask(wanted):
        scene = bpy.context.scene
        layer = addon.mask_layers.open_layers(scene).masks.get("pot")
        if wanted is None:
            assert not file_of(addon, scene).parent.exists() and addon.disk.read(scene).masks == {}
            assert layer is None or not layer.pixels.any()
        else:
            np.testing.assert_array_equal(mask(addon, scene), wanted)
            np.testing.assert_array_equal(layer.pixels, wanted)
            assert addon.disk.read(scene).masks == {"pot": 1}

    masks = [None]
    for (step, *arguments), wanted in GESTURES[gestures]:
        getattr(addon.steps, step)(bpy.context.scene, *arguments)
        bpy.ops.ed.undo_push(message=step)
        masks.append(wanted)
        assert_mask(wanted)
    for wanted in reversed(masks[:-1]):
        bpy.ops.ed.undo()
        assert_mask(wanted)
    for wanted in masks[1:]:
        bpy.ops.ed.redo()
        assert_mask(wanted)


def test_marks_are_segmented_without_further_choice(addon, marked):
    addon.steps.learn_scene(marked).wait()
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    assert addon.folders.absolute(marked.karf.masks) == addon.folders.project_of(marked).masks_folder
    addon.steps.segment(marked).wait()
    assert '"pot"' in addon.folders.project_of(marked).segmentation_report.read_text()


def test_mask_of_any_view_is_reopened_and_corrected(addon, marked):
    marked.karf.views["photo_1"].split = "test"
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    addon.steps.go_to_view(marked, 1)
    addon.steps.mark_stroke(marked, [(9, 9)], 2)
    assert addon.steps.go_to_view(marked, -1) == "photo_0"
    addon.steps.mark_stroke(marked, [(5, 5)], 1, "TAKE")
    np.testing.assert_array_equal(mask(addon, marked), disc(5, 5, 3) & ~disc(5, 5, 1))
    np.testing.assert_array_equal(mask(addon, marked, view="photo_1"), disc(9, 9, 2))


def test_given_mask_file_is_corrected_and_restored_by_undo(bpy, addon, marked, tmp_path):
    given = tmp_path / "given"
    for name in ("lid/images/photo_0.png", "lid/photo_1.png", "pot/photo_2.png"):
        write_disc(addon, given / name)
    before = {path: path.read_bytes() for path in given.rglob("*.png")}
    marked.karf.masks = str(given)
    assert marked.karf.marking.objects.keys() == ["pot", "lid"]
    marked.karf.marking.active = 1
    bpy.ops.ed.undo_push(message="chosen")
    addon.steps.mark_stroke(marked, [(8, 8)], 2, "TAKE")
    bpy.ops.ed.undo_push(message="corrected")
    changed = given / "lid" / "images" / "photo_0.png"
    np.testing.assert_array_equal(addon.images.read_mask(changed), disc(8, 8, 5) & ~disc(8, 8, 2))
    after = {path: path.read_bytes() for path in given.rglob("*.png")}
    assert {path for path in after if after[path] != before.get(path)} == {changed} and len(after) == 3
    bpy.ops.ed.undo()
    assert {path: path.read_bytes() for path in given.rglob("*.png")} == before


@pytest.mark.parametrize("make", NO_FILES[1:])
def test_special_file_in_place_of_a_mask_is_rejected_without_waiting(addon, marked, make):
    file_of(addon, marked).parent.mkdir(parents=True)
    make(file_of(addon, marked))
    with pytest.raises(addon.engine_api.DataError, match=r"photo_0\.png is a pipe"):
        addon.steps.mark_stroke(marked, [(5, 5)], 3)


def test_smaller_mask_is_reopened_at_full_size(addon, marked, tmp_path):
    addon.images.write_png(tmp_path / "given" / "pot" / "photo_0.png", disc(8, 8, 5)[::2, ::2, None].repeat(3, -1))
    marked.karf.masks = str(tmp_path / "given")
    addon.steps.mark_stroke(marked, [(23, 15)], 1)
    assert mask(addon, marked).shape == SHAPE and mask(addon, marked)[8, 8]


@pytest.mark.parametrize(
    "mark",
    [
        ("mark_stroke", [(3, 3)], 3),
        ("mark_lasso", [(1, 1), (6, 1), (6, 5), (1, 5)]),
        ("mark_box", (1, 1), (6, 5)),
        ("mark_click", (3, 3)),
    ],
    ids=lambda mark: mark[0],
)
def test_first_mark_gives_an_object_a_tint_unlike_its_color_and_other_objects(bpy, addon, marked, mark):
    def tints():
        objects = bpy.context.scene.karf.marking.objects
        return [addon.engine_api.rgb_to_hex(addon.objects.tint(item)) for item in objects]

    blue, yellow, green = addon.tints.TINTS[0], addon.tints.TINTS[2], addon.tints.TINTS[3]
    assert tints() == [blue]
    marked.karf.active_view = "photo_2"
    addon.steps.show_photo(marked)
    step, *arguments = mark
    getattr(addon.steps, step)(marked, *arguments)  # on blue
    bpy.ops.ed.undo_push(message="mark")
    assert tints() == [yellow]
    addon.steps.mark_stroke(bpy.context.scene, [(20, 3)], 3)  # on green
    bpy.ops.ed.undo_push(message="stroke")
    assert tints() == [yellow]
    addon.steps.add_object(bpy.context.scene, "lid")
    addon.steps.mark_stroke(bpy.context.scene, [(3, 3)], 3)
    assert tints() == [yellow, green]
    bpy.ops.ed.undo()
    assert tints() == [yellow]


def test_stroke_after_undo_starts_a_new_branch(bpy, addon, marked):
    for place in ((5, 5), (15, 8)):
        addon.steps.mark_stroke(bpy.context.scene, [place], 3)
        bpy.ops.ed.undo_push(message="stroke")
        np.testing.assert_array_equal(mask(addon, bpy.context.scene), disc(*place, 3))
        bpy.ops.ed.undo()
        assert mask(addon, bpy.context.scene) is None


def test_reopened_file_forgets_strokes_but_keeps_masks(addon, marked, reopen):
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    scene = reopen()
    assert scene.karf.marking.step == 0 and scene.karf.marking.objects.keys() == ["pot"]
    addon.steps.mark_stroke(scene, [(15, 8)], 2)
    np.testing.assert_array_equal(mask(addon, scene), disc(5, 5, 3) | disc(15, 8, 2))


# --- clicks ----------------------------------------------------------------------------------------------------------
def test_undo_removes_a_click_from_the_query(bpy, addon, marked):
    addon.steps.mark_box(marked, (4, 4), (20, 12))
    for place, is_object in (((6, 6), "TAKE"), ((16, 6), "ADD")):
        addon.steps.mark_click(bpy.context.scene, place, is_object)
        bpy.ops.ed.undo_push(message="click")
    assert addon.proposals.current(bpy.context.scene, "pot").points == ((6, 6, False), (16, 6, True))
    bpy.ops.ed.undo()
    assert addon.proposals.current(bpy.context.scene, "pot").points == ((6, 6, False),)


def test_answer_overtaken_by_undo_changes_nothing(bpy, addon, marked, monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(addon.queries, "send", lambda scene, kind, options, on_answer: asked.append(on_answer))
    addon.steps.mark_click(bpy.context.scene, (6, 6))
    bpy.ops.ed.undo_push(message="click")
    bpy.ops.ed.undo()
    write_disc(addon, tmp_path / "answer.png")
    asked[0](bpy.context.scene, {"mask": str(tmp_path / "answer.png")})
    assert mask(addon, bpy.context.scene) is None
    bpy.ops.ed.redo()
    np.testing.assert_array_equal(mask(addon, bpy.context.scene), disc(8, 8, 5))


def test_without_an_engine_boxes_are_rectangles_and_clicks_fail(addon, marked, monkeypatch):
    monkeypatch.setenv("KARF_ENGINE_PYTHON", "/nowhere/python")
    addon.state.refresh()
    addon.steps.mark_box(marked, (3.4, 2.6), (20.5, 12.4))
    np.testing.assert_array_equal(mask(addon, marked), BOX)
    with pytest.raises(addon.engine_api.BadRequest, match="Clicks need the engine"):
        addon.steps.mark_click(marked, (6, 6))


# --- corrections -----------------------------------------------------------------------------------------------------
@pytest.fixture
def correcting(addon, marked):
    marked.karf.active_view = "photo_2"
    addon.steps.learn_scene(marked).wait()
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    addon.steps.segment(marked).wait()
    marked.karf.active_view = "photo_0"
    marked.karf.marking.correct = True
    addon.steps.show_photo(marked)
    return marked


def test_correct_shows_the_photo_and_selects_a_tool(bpy, addon, correcting, image_editor):
    image_editor.spaces.active.image = addon.images.new_image("KaRF", 24, 16)
    correcting.karf.marking.correct = False
    addon.tools.lay_down()
    assert not addon.photo.areas(correcting)
    correcting.karf.marking.correct = True
    assert addon.photo.areas(correcting) == [image_editor]
    assert bpy.context.window_manager.windows[0].workspace.tools.from_space_image_mode("VIEW").idname == "karf.mark_box"
    addon.tools.lay_down()


def test_corrections_are_written_and_solved_at_once(addon, correcting):
    file = addon.objects.mark_folders(correcting)[1] / "pot" / "photo_0.png"
    solved = addon.mask_layers.open_layers(correcting).solved["pot"]
    assert solved.pixels[:, :12].all() and not solved.pixels[:, 12:].any()
    for (place, radius, kind), expected in (
        (((5, 5), 3, "ADD"), disc(5, 5, 3).astype(int)),
        (((15, 8), 3, "TAKE"), disc(5, 5, 3).astype(int) - disc(15, 8, 3)),
        (((5, 5), 1, "CLEAR"), (disc(5, 5, 3) & ~disc(5, 5, 1)).astype(int) - disc(15, 8, 3)),
    ):
        before = addon.mask_layers.open_layers(correcting).solved["pot"].version
        addon.steps.mark_stroke(correcting, [place], radius, kind)
        np.testing.assert_array_equal(addon.images.read_correction(file), expected)
        assert addon.mask_layers.open_layers(correcting).solved["pot"].version != before
    assert file.read_bytes()[25] == 4  # gray and alpha, by the PNG's header
    assert mask(addon, correcting) is None
    addon.steps.mark_stroke(correcting, [(12, 8)], 30, "CLEAR")
    addon.steps.mark_click(correcting, (5.5, 5.5), "TAKE")
    correction = addon.images.read_correction(file)
    assert correction[5, 5] == -1 and 0 < (correction != 0).sum() < 6  # a click is a small dot


# --- objects and views -----------------------------------------------------------------------------------------------
TYPED = "red flower", "Blüte", "a/b", "pot.", "aux", ".hidden", "Background", "  "
NAMES = "red flower", "Blüte", "a_b", "pot_", "_aux", "_.hidden", "_Background", "object"


def test_typed_names_become_valid_file_names(addon, project_scene):
    for typed, name in zip(TYPED, NAMES, strict=True):
        assert addon.steps.add_object(project_scene, typed) == name
        assert addon.engine_api.is_file_name(name)


def test_objects_and_projects_never_share_a_folder(addon, project_scene, tmp_path):
    addon.steps.show_photo(project_scene)  # adds a first object
    names = [addon.steps.add_object(project_scene, name) for name in ("pot", "pot", "Pot", "caf\u00e9")]
    assert names == ["pot", "pot 2", "Pot 3", "caf\u00e9"]
    # two Unicode forms of one word are listed once
    (addon.objects.masks_folder(project_scene) / "cafe\u0301").mkdir(parents=True)
    addon.objects.sync(project_scene)
    assert project_scene.karf.marking.objects.keys() == ["object", *names]
    write_disc(addon, tmp_path / "other" / "masks" / "lid" / "photo_0.png")
    project_scene.karf.project = str(tmp_path / "other")
    assert project_scene.karf.marking.objects.keys() == ["lid"]


def test_renaming_and_removing_an_object_take_its_masks_and_undo_restores_them(bpy, addon, marked):
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    bpy.ops.ed.undo_push(message="stroke")

    def rename():
        bpy.context.scene.karf.marking.objects[0].name = "red flower"

    for change, masks in ((rename, {"red flower": 1}), (bpy.ops.karf.remove_object, {})):
        change()
        bpy.ops.ed.undo_push(message="change")
        assert addon.disk.read(bpy.context.scene).masks == masks
        assert bpy.context.scene.karf.marking.objects.keys() == list(masks)
        bpy.ops.ed.undo()
        assert addon.disk.read(bpy.context.scene).masks == {"pot": 1}
        assert bpy.context.scene.karf.marking.objects[0].folder == "pot"


def test_stepping_through_views_wraps_around_and_can_skip_unmarked_ones(addon, marked):
    assert [addon.steps.go_to_view(marked, 1) for _ in range(3)] == ["photo_1", "photo_2", "photo_0"]
    with pytest.raises(addon.engine_api.BadRequest, match="is not marked in any view"):
        addon.steps.go_to_view(marked, 1, marked=True)
    marked.karf.active_view = "photo_2"
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    marked.karf.active_view = "photo_0"
    assert addon.steps.go_to_view(marked, -1, marked=True) == "photo_2"


def test_suggested_views_are_visited_in_turn(addon, project_scene):
    addon.steps.learn_scene(project_scene).wait()
    project = addon.folders.project_of(project_scene)
    project.finish("segmentation", "s")
    report = project.segmentation_report
    addon.engine_api.write_json(report, {})
    with pytest.raises(addon.engine_api.BadRequest, match="No view is suggested"):
        addon.steps.go_to_suggested(project_scene)
    addon.engine_api.write_json(report, {"suggestions": {"photo_2": 0.9, "photo_1": 0.4}})
    assert [addon.steps.go_to_suggested(project_scene) for _ in range(3)] == ["photo_2", "photo_1", "photo_2"]


def test_boxes_and_meshes_become_volumes_and_undo_removes_them(bpy, addon, marked):
    scene = bpy.context.scene
    scene.karf.rig.location = (1, 2, 3)
    empty = bpy.data.objects.new("box", None)
    empty.location, empty.empty_display_size = (1, 2, 5), 0.5
    bpy.ops.mesh.primitive_cube_add(location=(2, 2, 3))
    scene.collection.objects.link(empty)
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="shapes")
    assert addon.steps.set_volume(scene, empty, "inside") == 1
    bpy.ops.ed.undo_push(message="first")
    assert addon.steps.set_volume(scene, bpy.context.active_object, "outside") == 2
    file = addon.folders.project_of(scene).volumes_file
    inside, outside = addon.engine_api.read_volumes(file)["pot"]
    np.testing.assert_allclose(inside.matrix, [[0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 0.5, 2], [0, 0, 0, 1]], atol=1e-6)
    np.testing.assert_allclose(outside.vertices.mean(0), [1, 0, 0], atol=1e-6)
    bpy.ops.ed.undo_push(message="second")
    bpy.ops.ed.undo()
    assert [volume.kind for volume in addon.engine_api.read_volumes(file)["pot"]] == ["inside"]
    assert addon.steps.set_volume(bpy.context.scene, None, "none") == 0 and not file.exists()
