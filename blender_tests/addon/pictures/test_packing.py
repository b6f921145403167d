"""Blender asks about modified images on saving and on quitting: never about those that the extension keeps itself."""

import time

import numpy as np

from ..timers import pretend_window, run_to_end


def test_a_picture_that_stands_still_is_no_modified_image(bpy, addon, learned, monkeypatch):
    pretend_window(bpy, monkeypatch, addon.images)
    addon.steps.set_swatch(learned, "pot", 1, (0.25, 0.5, 0.75))
    image = learned.karf.result
    before = addon.images.pixels(image).copy()
    assert image.is_dirty
    run_to_end(addon.images._pack_still_images)
    assert not image.is_dirty
    np.testing.assert_array_equal(addon.images.pixels(image), before)
    addon.steps.set_swatch(learned, "pot", 1, (0.75, 0.5, 0.25))  # it follows as before
    assert image.is_dirty and not np.array_equal(addon.images.pixels(image), before)
    run_to_end(addon.images._pack_still_images)
    assert not [each.name for each in bpy.data.images if each.is_dirty]


def test_a_picture_that_follows_the_mouse_is_not_packed_at_every_step(bpy, addon, learned, monkeypatch):
    pretend_window(bpy, monkeypatch, addon.images)
    addon.steps.set_swatch(learned, "pot", 1, (0.25, 0.5, 0.75))
    assert addon.images._pack_still_images() == addon.images.STILL_SECONDS
    assert learned.karf.result.is_dirty
    time.sleep(addon.images.STILL_SECONDS)
    assert addon.images._pack_still_images() is None


def test_a_picture_that_is_gone_by_then_is_none(bpy, addon, learned, monkeypatch):
    pretend_window(bpy, monkeypatch, addon.images)
    addon.steps.set_swatch(learned, "pot", 1, (0.25, 0.5, 0.75))
    bpy.data.images.remove(learned.karf.result)
    run_to_end(addon.images._pack_still_images)
