"""The workspace, the picture that its editors show by themselves, and the status bar."""

import numpy as np
import pytest


@pytest.fixture
def editor(bpy, scene):
    """A function that returns the Image Editor of the file that is open."""

    def areas():
        return bpy.data.window_managers[0].windows[0].screen.areas

    areas()[0].type = "IMAGE_EDITOR"
    return lambda: next(area for area in areas() if area.type == "IMAGE_EDITOR").spaces.active


@pytest.fixture
def window(bpy):
    return bpy.data.window_managers[0].windows[0]


def test_button_adds_only_one_workspace(bpy, addon, scene):
    kinds = ("scenes", "objects", "images", "brushes", "node_groups")
    before = {kind: len(getattr(bpy.data, kind)) for kind in kinds}
    for _ in range(2):
        assert bpy.ops.karf.open_workspace() == {"FINISHED"}
    (workspace,) = [each for each in bpy.data.workspaces if each.name.startswith("KaRF")]
    (screen,) = workspace.screens
    assert sorted(area.type for area in screen.areas) == ["DOPESHEET_EDITOR", "IMAGE_EDITOR", "VIEW_3D"]
    assert all(area.spaces.active.show_region_ui for area in screen.areas if area.type != "DOPESHEET_EDITOR")
    assert {kind: len(getattr(bpy.data, kind)) for kind in kinds} == before
    assert addon.opening.FILE.stat().st_size < 100_000


def test_unlearned_capture_is_ready_to_mark(addon, project_scene, window, editor):
    marking = project_scene.karf.marking
    for _ in range(2):
        addon.masks.begin_marking(window)
        assert [item.name for item in marking.objects] == ["object"]
        assert editor().image == marking.photo is not None


def test_learned_scene_is_left_unchanged(addon, project_scene, window, editor):
    addon.steps.learn_scene(project_scene).wait()
    addon.masks.begin_marking(window)
    assert project_scene.karf.marking.photo is None and not project_scene.karf.marking.objects


def test_workspace_shows_the_picture_of_a_learned_scene(addon, learned, window, editor):
    learned.karf.result = None  # as after importing a learned project
    addon.masks.begin_marking(window)
    assert editor().image == learned.karf.result is not None


def test_workspace_opens_without_photos(addon, project_scene, capture_folder, window, editor, capsys):
    for photo in (capture_folder / "images").glob("*.png"):
        photo.unlink()
    addon.masks.begin_marking(window)
    assert project_scene.karf.marking.photo is None or not project_scene.karf.marking.photo.size[0]
    assert "KaRF: " in capsys.readouterr().out


def test_opened_file_shows_its_picture(learned, editor, reopen):
    editor().image = None
    scene = reopen()
    assert editor().image == scene.karf.result is not None


def test_lost_preview_is_replaced_and_other_pictures_stay(bpy, addon, learned, editor):
    gone = bpy.data.images.new("KaRF preview", 1, 1)
    gone.source, gone.filepath = "FILE", "/nowhere/preview.png"
    editor().image = gone
    addon.following.show_again()
    assert editor().image == learned.karf.result != gone
    editor().image = own = bpy.data.images.new("sketch", 8, 8)
    addon.following.show_again()
    addon.following.show_own()
    assert editor().image == own


def test_each_scene_shows_its_own_picture(bpy, addon, learned, window, editor):
    def shown_in(scene):
        window.scene = scene
        addon.following.show_own()
        return editor().image

    editor().image, other = learned.karf.result, bpy.data.scenes.new("other")
    assert shown_in(other) is None
    assert shown_in(learned) == learned.karf.result
    other.karf.result = addon.images.new_image("KaRF", 8, 8)
    assert shown_in(other) == other.karf.result
    assert shown_in(learned) == learned.karf.result


def learned_colors(scene):
    return {item.name: [tuple(swatch.learned) for swatch in item.swatches] for item in scene.karf.objects}


def test_undo_keeps_first_palettes_and_picture(bpy, addon, project_scene, editor):
    addon.steps.learn_scene(project_scene).wait()
    bpy.ops.ed.undo_push(message="begin")
    addon.steps.extract_palette(bpy.context.scene).wait()
    before = learned_colors(bpy.context.scene)
    bpy.ops.ed.undo_push(message="Extract Palette")
    bpy.ops.ed.undo()
    assert learned_colors(bpy.context.scene) == before != {}
    assert editor().image == bpy.context.scene.karf.result is not None


def test_undo_keeps_newly_extracted_swatches(bpy, addon, learned):
    api, project = addon.engine_api, addon.folders.project_of(learned)
    bpy.ops.ed.undo_push(message="begin")
    content = api.read_json(project.palette_file, "palettes")
    for each in content["objects"]:
        each["colors"] = [[0, 0, 0], [0.1, 0.9, 0.3], [0.9, 0.9, 0.1]]
    api.write_json(project.palette_file, content)
    project.finish("recoloring", "anew")
    addon.palettes.import_learned(learned)
    found = learned_colors(learned)
    bpy.ops.ed.undo_push(message="Extract Palette")
    bpy.ops.ed.undo()
    assert learned_colors(bpy.context.scene) == found
    np.testing.assert_allclose(found["pot"][1], (0.1, 0.9, 0.3), atol=1e-6)


def n_draws(bpy, addon):
    return bpy.types.STATUSBAR_HT_header.draw._draw_funcs.count(addon.statusbar.draw)


def test_status_bar_shows_jobs_after_an_installation(bpy, addon):
    workspace, header = bpy.data.workspaces[0], bpy.types.STATUSBAR_HT_header
    addon.extension.unregister()
    header.draw = header.draw._draw_funcs[0]  # as in a session where nothing was added
    if hasattr(header, "_draw_orig"):
        del header._draw_orig
    workspace.status_text_set("Installing")  # as the operator that enables the extension
    addon.extension.register()
    workspace.status_text_set(None)
    assert n_draws(bpy, addon) == 1


def test_status_bar_shows_jobs_after_a_tools_text(bpy, addon):
    workspace = bpy.data.workspaces[0]
    workspace.status_text_set(lambda header, context: None)
    addon.extension.unregister()
    addon.extension.register()
    workspace.status_text_set(None)
    assert n_draws(bpy, addon) == 1
    addon.extension.unregister()
    assert n_draws(bpy, addon) == 0
    addon.extension.register()


def test_a_copied_scene_has_its_own_picture(bpy, addon, learned, image_editor):
    first = image_editor.spaces.active.image = learned.karf.result
    bpy.ops.scene.new(type="FULL_COPY")
    copy = bpy.context.scene
    addon.steps.set_swatch(copy, "pot", 1, "#204060")
    assert learned.karf.result == first != copy.karf.result
    assert not (addon.images.pixels(first) == addon.images.pixels(copy.karf.result)).all()
    assert image_editor.spaces.active.image == copy.karf.result
