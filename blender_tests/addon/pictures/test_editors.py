"""Which picture the Image Editors show, and how much of it."""

import numpy as np
import pytest


@pytest.fixture
def editor(bpy, addon, learned, monkeypatch):
    """An Image Editor; `fitted` are the names of the pictures that it was fitted to."""
    area = bpy.data.window_managers[0].windows[0].screen.areas[0]
    area.type = "IMAGE_EDITOR"
    space = area.spaces.active
    fitted = []
    monkeypatch.setattr(addon.editors, "fit", lambda area: fitted.append(area.spaces.active.image.name))
    yield space, fitted
    space.image = None


def test_the_picture_that_a_job_brings_is_shown_whole_once(addon, learned, editor):
    space, fitted = editor
    addon.steps.extract_palette(learned).wait()
    assert space.image == learned.karf.result and fitted == ["KaRF"]
    addon.steps.extract_palette(learned).wait()  # the artist may have zoomed in meanwhile
    assert fitted == ["KaRF"]


def test_a_picture_that_takes_the_place_of_the_photo_to_mark_is_shown_whole(bpy, addon, learned, editor):
    space, fitted = editor
    space.image = bpy.data.images.new("KaRF photo", 8, 8)
    addon.steps.extract_palette(learned).wait()
    assert fitted == ["KaRF"]


def test_where_the_picture_comes_the_marking_tools_are_laid_down(bpy, addon, learned, editor):
    space, _ = editor
    window = bpy.data.window_managers[0].windows[0]
    bpy.ops.karf.mark()
    with bpy.context.temp_override(window=window):
        addon.tools.take_up(bpy.context, window.screen.areas[0])
    assert space.image == learned.karf.marking.photo
    addon.steps.extract_palette(learned).wait()
    assert space.image == learned.karf.result
    assert window.workspace.tools.from_space_image_mode("VIEW").idname == addon.tools.BLENDERS
    assert not learned.karf.marking.correct


def test_a_picture_of_the_artists_own_stays_as_it_is_shown(bpy, addon, learned, editor):
    space, fitted = editor
    space.image = own = bpy.data.images.new("sketch", 8, 8)
    addon.steps.extract_palette(learned).wait()
    assert space.image == own and fitted == []


def test_an_editor_with_a_picture_that_cannot_be_read_is_left_alone(bpy, addon, tmp_path):
    window = bpy.data.window_managers[0].windows[0]
    area = window.screen.areas[0]
    area.type = "IMAGE_EDITOR"
    area.spaces.active.image = bpy.data.images.load(str(_damaged(addon, tmp_path)))
    addon.editors.fit(area)


def _damaged(addon, folder):
    addon.images.write_png(folder / "damaged.png", np.zeros((4, 4, 3)))
    (folder / "damaged.png").write_bytes((folder / "damaged.png").read_bytes()[:20])
    return folder / "damaged.png"
