"""The KaRF workspace comes with its editors, once, and brings nothing else into the file."""

import pytest


def test_the_button_adds_the_workspace_once_and_nothing_else(bpy, addon, scene):
    kinds = ("scenes", "objects", "images", "brushes", "node_groups")
    before = {kind: len(getattr(bpy.data, kind)) for kind in kinds}
    for _ in range(2):
        assert bpy.ops.karf.open_workspace() == {"FINISHED"}
    (workspace,) = [each for each in bpy.data.workspaces if each.name.startswith("KaRF")]
    (screen,) = workspace.screens
    assert sorted(area.type for area in screen.areas) == ["DOPESHEET_EDITOR", "IMAGE_EDITOR", "VIEW_3D"]
    sided = [area.spaces.active.show_region_ui for area in screen.areas if area.type != "DOPESHEET_EDITOR"]
    assert sided == [True, True]
    assert {kind: len(getattr(bpy.data, kind)) for kind in kinds} == before


def test_the_file_that_it_comes_from_is_small(addon):
    assert addon.opening.FILE.stat().st_size < 100_000


@pytest.fixture
def opened(bpy, project_scene):
    """A window with an Image Editor, and a capture of which nothing is learned."""
    window = bpy.data.window_managers[0].windows[0]
    window.screen.areas[0].type = "IMAGE_EDITOR"
    return window


def picture_in(window):
    return next(area for area in window.screen.areas if area.type == "IMAGE_EDITOR").spaces.active.image


def test_a_capture_is_ready_to_mark_in_the_workspace(addon, opened, project_scene):
    addon.masks.begin_marking(opened)
    marking = project_scene.karf.marking
    assert [item.name for item in marking.objects] == ["object"]
    assert picture_in(opened) == marking.photo is not None
    addon.masks.begin_marking(opened)
    assert len(marking.objects) == 1


def test_what_is_learned_is_left_as_it_is_shown(addon, opened, project_scene):
    addon.steps.learn_scene(project_scene).wait()
    addon.masks.begin_marking(opened)
    assert project_scene.karf.marking.photo is None and not project_scene.karf.marking.objects


def test_of_what_is_learned_the_workspace_shows_the_picture(bpy, addon, learned):
    window = bpy.data.window_managers[0].windows[0]
    window.screen.areas[0].type = "IMAGE_EDITOR"
    window.screen.areas[0].spaces.active.image = None
    learned.karf.result = None  # imported with a project that was learned before
    addon.masks.begin_marking(window)
    assert picture_in(window) == learned.karf.result is not None


def test_without_a_photo_the_workspace_opens_all_the_same(addon, opened, project_scene, capture_folder, capsys):
    for photo in (capture_folder / "images").glob("*.png"):
        photo.unlink()
    addon.masks.begin_marking(opened)
    assert project_scene.karf.marking.photo is None or not project_scene.karf.marking.photo.size[0]
    assert "KaRF: " in capsys.readouterr().out
