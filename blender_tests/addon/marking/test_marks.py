"""Marks on photos: what they write, how they are reopened, corrected and taken back."""

import shutil

import numpy as np
import pytest

from blender_tests.engine.reference.no_files import NO_FILES

SHAPE = 16, 24


@pytest.fixture
def marked(bpy, addon, project_scene):
    """The scene with the photo to mark and an object `pot`, as undo finds it."""
    addon.steps.add_object(project_scene, "pot")
    addon.steps.show_photo(project_scene)
    bpy.ops.ed.undo_push(message="begin")
    return project_scene


@pytest.fixture
def no_engine(addon, monkeypatch):
    monkeypatch.setenv("KARF_ENGINE_PYTHON", "/nowhere/python")
    addon.state.refresh()


def file_of(addon, scene, name="pot", view="photo_0"):
    return addon.objects.masks_folder(scene) / name / f"{view}.png"


def mask(addon, scene, name="pot", view="photo_0"):
    return addon.images.read_mask(file_of(addon, scene, name, view))


def disc(x, y, radius):
    rows, columns = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]] + 0.5
    return np.hypot(columns - x, rows - y) <= radius


# --- strokes and files ---------------------------------------------------------------------------------------------
def test_a_stroke_is_on_the_disk_at_once_and_the_folder_is_chosen(addon, marked):
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    np.testing.assert_array_equal(mask(addon, marked), disc(5, 5, 3))
    assert addon.disk.read(marked).masks == {"pot": 1}
    assert addon.folders.absolute(marked.karf.masks) == addon.folders.project_of(marked).masks_folder


def test_brush_lasso_and_eraser_work_on_one_mask(addon, marked):
    addon.steps.mark_stroke(marked, [(5, 5), (5, 9)], 2)
    addon.steps.mark_lasso(marked, [(10, 2), (20, 2), (20, 12), (10, 12)])
    addon.steps.mark_stroke(marked, [(5, 5)], 30, "TAKE")
    assert not file_of(addon, marked).exists()
    addon.steps.mark_lasso(marked, [(10, 2), (20, 2), (20, 12), (10, 12)])
    addon.steps.mark_stroke(marked, [(15, 7)], 2, "TAKE")
    expected = np.zeros(SHAPE, bool)
    expected[2:12, 10:20] = True
    np.testing.assert_array_equal(mask(addon, marked), expected & ~disc(15, 7, 2))


def test_an_erased_mask_is_no_file_and_no_object_to_the_engine(addon, marked):
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    addon.steps.erase_mask(marked)
    assert not file_of(addon, marked).parent.exists()
    assert addon.disk.read(marked).masks == {}


def test_a_mask_is_reopened_and_corrected(addon, marked):
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    addon.steps.go_to_view(marked, 1)
    addon.steps.mark_stroke(marked, [(9, 9)], 2)
    assert addon.steps.go_to_view(marked, -1) == "photo_0"
    addon.steps.mark_stroke(marked, [(5, 5)], 1, "TAKE")
    np.testing.assert_array_equal(mask(addon, marked), disc(5, 5, 3) & ~disc(5, 5, 1))
    np.testing.assert_array_equal(mask(addon, marked, view="photo_1"), disc(9, 9, 2))


def test_a_mask_of_the_users_own_folder_is_corrected_in_its_file_and_others_are_left_alone(addon, marked, tmp_path):
    given = tmp_path / "given"
    for name in ("lid/images/photo_0.png", "lid/photo_1.png", "pot/photo_2.png"):
        addon.images.write_png(given / name, disc(8, 8, 5)[..., None].repeat(3, -1))
    before = {path: path.read_bytes() for path in given.rglob("*.png")}
    marked.karf.masks = str(given)
    assert marked.karf.marking.objects.keys() == ["pot", "lid"]
    marked.karf.marking.active = 1
    addon.steps.mark_stroke(marked, [(8, 8)], 2, "TAKE")
    changed = given / "lid" / "images" / "photo_0.png"
    np.testing.assert_array_equal(addon.images.read_mask(changed), disc(8, 8, 5) & ~disc(8, 8, 2))
    after = {path: path.read_bytes() for path in given.rglob("*.png")}
    assert {path for path in after if after[path] != before.get(path)} == {changed} and len(after) == 3


@pytest.mark.parametrize("make", NO_FILES[1:])
def test_what_lies_in_place_of_a_mask_is_named_and_never_waited_for(addon, marked, make):
    file_of(addon, marked).parent.mkdir(parents=True)
    make(file_of(addon, marked))
    with pytest.raises(addon.engine_api.DataError, match=r"photo_0\.png is a pipe"):
        addon.steps.mark_stroke(marked, [(5, 5)], 3)


def test_a_mask_of_the_size_that_is_learned_from_is_reopened(addon, marked, tmp_path):
    addon.images.write_png(tmp_path / "given" / "pot" / "photo_0.png", disc(8, 8, 5)[::2, ::2, None].repeat(3, -1))
    marked.karf.masks = str(tmp_path / "given")
    addon.steps.mark_stroke(marked, [(23, 15)], 1)
    assert mask(addon, marked).shape == SHAPE and mask(addon, marked)[8, 8]


def test_every_photo_can_be_marked(addon, marked):
    marked.karf.views["photo_1"].split = "test"
    addon.steps.go_to_view(marked, 1)
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    assert file_of(addon, marked, view="photo_1").exists()


def test_marks_are_segmented_without_further_choice(addon, marked):
    addon.steps.learn_scene(marked).wait()
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    addon.steps.segment(marked).wait()
    assert '"pot"' in addon.folders.project_of(marked).segmentation_report.read_text()


# --- undo ----------------------------------------------------------------------------------------------------------
def test_undo_takes_strokes_back_one_by_one_and_redo_brings_them_again(bpy, addon, marked):
    scene = bpy.context.scene
    for number, place in enumerate(((5, 5), (15, 8))):
        addon.steps.mark_stroke(scene, [place], 3)
        bpy.ops.ed.undo_push(message=f"stroke {number}")
    both = mask(addon, scene)
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    np.testing.assert_array_equal(mask(addon, scene), disc(5, 5, 3))
    np.testing.assert_array_equal(addon.mask_layers.open_layers(scene).masks["pot"].pixels, disc(5, 5, 3))
    bpy.ops.ed.undo()
    assert not file_of(addon, bpy.context.scene).exists()
    for _ in range(2):
        bpy.ops.ed.redo()
    np.testing.assert_array_equal(mask(addon, bpy.context.scene), both)


def test_undo_brings_a_mask_of_the_users_own_back_byte_for_byte(bpy, addon, marked, tmp_path):
    file = tmp_path / "given" / "pot" / "photo_0.png"
    addon.images.write_png(file, disc(8, 8, 5)[..., None].repeat(3, -1))
    before = file.read_bytes()
    marked.karf.masks = str(tmp_path / "given")
    bpy.ops.ed.undo_push(message="chosen")
    addon.steps.erase_mask(marked)
    bpy.ops.ed.undo_push(message="erased")
    assert not file.exists()
    bpy.ops.ed.undo()
    assert file.read_bytes() == before


def test_after_undo_another_stroke_is_a_way_of_its_own(bpy, addon, marked):
    scene = bpy.context.scene
    addon.steps.mark_stroke(scene, [(5, 5)], 3)
    bpy.ops.ed.undo_push(message="first")
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    addon.steps.mark_stroke(scene, [(15, 8)], 2)
    bpy.ops.ed.undo_push(message="second")
    np.testing.assert_array_equal(mask(addon, scene), disc(15, 8, 2))
    bpy.ops.ed.undo()
    assert not file_of(addon, bpy.context.scene).exists()


def test_another_file_forgets_the_strokes_and_leaves_the_masks(bpy, addon, marked, tmp_path):
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    scene = bpy.context.scene
    assert scene.karf.marking.step == 0 and scene.karf.marking.objects.keys() == ["pot"]
    addon.steps.mark_stroke(scene, [(15, 8)], 2)
    np.testing.assert_array_equal(mask(addon, scene), disc(5, 5, 3) | disc(15, 8, 2))


# --- clicks and boxes ----------------------------------------------------------------------------------------------
def test_a_box_and_clicks_become_what_the_engine_makes_of_them(bpy, addon, marked):
    addon.steps.mark_box(marked, (4, 4), (20, 12))
    box = mask(addon, marked)
    assert box.sum() == 16 * 8
    addon.steps.mark_click(marked, (6, 6), "TAKE")
    near = np.hypot(*(np.mgrid[0:16, 0:24] + 0.5 - np.array([6, 6])[:, None, None])) < 3
    np.testing.assert_array_equal(mask(addon, marked), box & ~near)
    assert addon.proposals.current(marked, "pot").points == ((6, 6, False),)


def test_undo_takes_a_click_back_with_its_answer(bpy, addon, marked):
    scene = bpy.context.scene
    addon.steps.mark_click(scene, (6, 6))
    bpy.ops.ed.undo_push(message="first")
    first = mask(addon, scene)
    addon.steps.mark_click(scene, (16, 6))
    bpy.ops.ed.undo_push(message="second")
    assert len(addon.proposals.current(scene, "pot").points) == 2
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    np.testing.assert_array_equal(mask(addon, scene), first)
    assert len(addon.proposals.current(scene, "pot").points) == 1


def test_a_click_on_a_mask_that_was_painted_adds_and_takes_away_there_alone(addon, marked):
    addon.steps.mark_stroke(marked, [(8, 8)], 6)
    painted = mask(addon, marked)
    addon.steps.mark_click(marked, (20, 8))
    assert (mask(addon, marked) & painted).sum() == painted.sum() and mask(addon, marked)[8, 20]
    addon.steps.mark_stroke(marked, [(1, 1)], 1)
    addon.steps.mark_click(marked, (8, 8), "TAKE")
    assert not mask(addon, marked)[8, 8] and mask(addon, marked)[8, 20] and mask(addon, marked)[8, 3]


def test_an_answer_that_undo_has_overtaken_changes_nothing(bpy, addon, marked, monkeypatch):
    asked = []
    monkeypatch.setattr(addon.queries, "send", lambda scene, kind, options, on_answer: asked.append(on_answer))
    scene = bpy.context.scene
    addon.steps.mark_click(scene, (6, 6))
    bpy.ops.ed.undo_push(message="click")
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    answer = file_of(addon, scene).parent.parent / "answer.png"
    addon.images.write_png(answer, disc(6, 6, 3)[..., None].repeat(3, -1))
    shutil.copy(answer, copy := answer.with_name("copy.png"))
    asked[0](scene, {"mask": str(copy)})
    assert not file_of(addon, scene).exists()
    bpy.ops.ed.redo()  # and there it is
    np.testing.assert_array_equal(mask(addon, bpy.context.scene), disc(6, 6, 3))


def test_without_an_engine_a_box_is_a_rectangle_and_a_click_says_why_not(addon, marked, no_engine):
    addon.steps.mark_box(marked, (4, 4), (20, 12))
    assert mask(addon, marked).sum() == 16 * 8
    with pytest.raises(addon.engine_api.BadRequest, match="Clicks need the engine"):
        addon.steps.mark_click(marked, (6, 6))


# --- corrections ---------------------------------------------------------------------------------------------------
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


def corrections(addon, scene):
    return addon.objects.mark_folders(scene)[1] / "pot" / "photo_0.png"


def test_correct_brings_the_photo_and_a_tool_so_that_the_first_stroke_counts(bpy, addon, correcting):
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    area.type = "IMAGE_EDITOR"
    area.spaces.active.image = addon.images.new_image("KaRF", 24, 16)
    correcting.karf.marking.correct = False
    addon.tools.lay_down()
    assert not addon.photo.areas(correcting)
    correcting.karf.marking.correct = True
    assert addon.photo.areas(correcting) == [area]
    assert window.workspace.tools.from_space_image_mode("VIEW").idname == "karf.mark_box"
    addon.tools.lay_down()


def test_corrections_say_is_is_not_and_nothing(addon, correcting):
    addon.steps.mark_stroke(correcting, [(5, 5)], 3)
    addon.steps.mark_stroke(correcting, [(15, 8)], 3, "TAKE")
    addon.steps.mark_stroke(correcting, [(5, 5)], 1, "CLEAR")
    said = addon.images.read_correction(corrections(addon, correcting))
    expected = (disc(5, 5, 3) & ~disc(5, 5, 1)).astype(int) - disc(15, 8, 3)
    np.testing.assert_array_equal(said, expected)
    assert corrections(addon, correcting).read_bytes()[25] == 4  # gray and alpha, by the PNG's header
    assert not file_of(addon, correcting).exists()


def test_a_click_is_a_small_dot_of_a_correction(addon, correcting):
    addon.steps.mark_click(correcting, (5.5, 5.5), "TAKE")
    said = addon.images.read_correction(corrections(addon, correcting))
    assert said[5, 5] == -1 and 0 < (said != 0).sum() < 6


def test_the_engines_corrected_masks_are_shown_at_once(addon, correcting):
    solved = addon.mask_layers.open_layers(correcting).solved["pot"]
    assert solved.pixels[:, :12].all() and not solved.pixels[:, 12:].any()
    before = solved.version
    addon.steps.mark_stroke(correcting, [(15, 8)], 3)
    assert addon.mask_layers.open_layers(correcting).solved["pot"].version != before


# --- objects and views ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "typed, name",
    [
        ("red flower", "red flower"),
        ("Blüte", "Blüte"),
        ("a/b", "a_b"),
        ("pot.", "pot_"),
        ("aux", "_aux"),
        (".hidden", "_.hidden"),
        ("Background", "_Background"),
        ("  ", "object"),
    ],
)
def test_every_name_that_people_type_becomes_one_that_works(addon, project_scene, typed, name):
    assert addon.steps.add_object(project_scene, typed) == name
    assert addon.engine_api.is_file_name(name)


def test_two_objects_never_share_a_folder(addon, project_scene):
    assert [addon.steps.add_object(project_scene, name) for name in ("pot", "pot", "Pot")] == ["pot", "pot 2", "Pot 3"]


def test_one_word_in_two_unicode_forms_is_listed_once(addon, project_scene):
    composed, decomposed = "caf\u00e9", "cafe\u0301"
    addon.steps.add_object(project_scene, composed)
    (addon.objects.masks_folder(project_scene) / decomposed).mkdir(parents=True)
    addon.objects.sync(project_scene)
    assert project_scene.karf.marking.objects.keys() == [composed]


def test_a_renamed_object_keeps_its_marks_and_undo_renames_it_back(bpy, addon, marked):
    scene = bpy.context.scene
    addon.steps.mark_stroke(scene, [(5, 5)], 3)
    bpy.ops.ed.undo_push(message="stroke")
    scene.karf.marking.objects[0].name = "red flower"
    bpy.ops.ed.undo_push(message="renamed")
    assert addon.disk.read(scene).masks == {"red flower": 1}
    bpy.ops.ed.undo()
    assert addon.disk.read(bpy.context.scene).masks == {"pot": 1}
    assert bpy.context.scene.karf.marking.objects[0].folder == "pot"


def test_a_removed_object_takes_its_masks_along_and_undo_brings_them_back(bpy, addon, marked):
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    bpy.ops.ed.undo_push(message="stroke")
    assert bpy.ops.karf.remove_object() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="removed")
    assert addon.disk.read(bpy.context.scene).masks == {} and not bpy.context.scene.karf.marking.objects
    bpy.ops.ed.undo()
    assert addon.disk.read(bpy.context.scene).masks == {"pot": 1}


def test_views_are_gone_through_around_the_end_and_marked_ones_alone_where_wanted(bpy, addon, marked):
    seen = [addon.steps.go_to_view(marked, 1) for _ in range(3)]
    assert seen == ["photo_1", "photo_2", "photo_0"]
    with pytest.raises(addon.engine_api.BadRequest, match="is not marked in any view"):
        addon.steps.go_to_view(marked, 1, marked=True)
    marked.karf.active_view = "photo_2"
    addon.steps.mark_stroke(marked, [(5, 5)], 3)
    marked.karf.active_view = "photo_0"
    assert addon.steps.go_to_view(marked, -1, marked=True) == "photo_2"


def test_the_first_object_is_there_when_the_photo_is(addon, project_scene):
    addon.steps.show_photo(project_scene)
    assert project_scene.karf.marking.objects.keys() == ["object"]


def test_another_project_brings_its_own_objects(addon, marked, tmp_path):
    given = tmp_path / "other" / "masks" / "lid" / "photo_0.png"
    addon.images.write_png(given, disc(8, 8, 5)[..., None].repeat(3, -1))
    marked.karf.project = str(tmp_path / "other")
    assert marked.karf.marking.objects.keys() == ["lid"]


def test_suggested_views_come_one_after_the_other(addon, correcting):
    with pytest.raises(addon.engine_api.BadRequest, match="No view is suggested"):
        addon.steps.go_to_suggested(correcting)
    report = addon.folders.project_of(correcting).segmentation_report
    addon.engine_api.write_json(report, {"suggestions": {"photo_2": 0.9, "photo_1": 0.4}})
    assert [addon.steps.go_to_suggested(correcting) for _ in range(3)] == ["photo_2", "photo_1", "photo_2"]


def test_a_box_and_a_mesh_become_volumes_of_the_captures_world_and_undo_takes_them_back(bpy, addon, marked):
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
