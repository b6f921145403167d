"""The picture that Image Editors show, and how it is fitted."""

import numpy as np
import pytest


@pytest.fixture
def editor(addon, learned, image_editor, monkeypatch):
    """An Image Editor's space, and the names of the pictures that it was fitted to."""
    space, fitted = image_editor.spaces.active, []
    monkeypatch.setattr(addon.editors, "fit", lambda area: fitted.append(area.spaces.active.image.name))
    yield space, fitted
    space.image = None


@pytest.mark.parametrize("before", ["", "KaRF photo", "sketch"])
def test_new_picture_is_fitted_once_and_never_replaces_other_images(bpy, addon, learned, editor, before):
    space, fitted = editor
    own = bpy.data.images.new(before, 8, 8) if before else None
    space.image = own
    for _ in range(2):  # a second fit would undo the artist's zoom
        addon.steps.extract_palette(learned).wait()
        if before == "sketch":
            assert space.image == own and fitted == []
        else:
            assert space.image == learned.karf.result and fitted == ["KaRF"]


def test_new_picture_deselects_the_marking_tools(bpy, addon, learned, editor, image_editor):
    space, _ = editor
    window = bpy.data.window_managers[0].windows[0]
    bpy.ops.karf.mark()
    with bpy.context.temp_override(window=window):
        addon.tools.take_up(bpy.context, image_editor)
    assert space.image == learned.karf.marking.photo
    addon.steps.extract_palette(learned).wait()
    assert space.image == learned.karf.result
    assert window.workspace.tools.from_space_image_mode("VIEW").idname == addon.tools.BLENDERS
    assert not learned.karf.marking.correct


def test_fitting_ignores_an_unreadable_picture(bpy, addon, image_editor, tmp_path):
    file = tmp_path / "damaged.png"
    addon.images.write_png(file, np.zeros((4, 4, 3)))
    file.write_bytes(file.read_bytes()[:20])
    image_editor.spaces.active.image = bpy.data.images.load(str(file))
    addon.editors.fit(image_editor)
