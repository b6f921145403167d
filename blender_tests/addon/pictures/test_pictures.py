"""Picture files, image packing and object tints."""

import time
from itertools import combinations

import numpy as np
import pytest

from ..timers import pretend_window, run_to_end


def test_pixels_survive_a_file_round_trip(addon, tmp_path):
    ramp = (np.arange(256, dtype=np.float32) / np.float32(255)).reshape(16, 16, 1).repeat(3, axis=2)
    addon.images.write_png(tmp_path / "ramp.png", ramp)
    np.testing.assert_allclose(addon.images.read_picture(tmp_path / "ramp.png") * 255, ramp * 255, atol=1e-4)
    (tmp_path / "broken.png").write_text("no picture")
    with pytest.raises(addon.engine_api.DataError, match=r"broken\.png"):
        addon.images.read_picture(tmp_path / "broken.png")


@pytest.mark.parametrize("brightest", [1, 255, None])
def test_mask_is_read_as_the_engine_reads_it(addon, tmp_path, brightest):
    mask = np.zeros((4, 6, 1), np.uint8)
    mask[1:3, 2:5] = 255
    if brightest:
        addon.images.write_png(tmp_path / "mask.png", (mask > 0).repeat(3, axis=-1) * brightest / 255)
    else:  # the alpha of a cut-out is a mask
        content = addon.raster.encode_png(np.concatenate([np.zeros_like(mask), mask], -1))
        (tmp_path / "mask.png").write_bytes(content)
    np.testing.assert_array_equal(addon.images.read_mask(tmp_path / "mask.png"), mask[..., 0] > 0)


@pytest.fixture
def changed(bpy, addon, learned, monkeypatch):
    """The scene in a window, with a picture that has just changed."""
    pretend_window(bpy, monkeypatch, addon.images)
    addon.steps.set_swatch(learned, "pot", 1, (0.25, 0.5, 0.75))
    assert learned.karf.result.is_dirty
    return learned


def test_still_picture_is_packed_and_no_longer_modified(bpy, addon, changed):
    image = changed.karf.result
    before = addon.images.pixels(image).copy()
    run_to_end(addon.images._pack_still_images)
    assert not image.is_dirty
    np.testing.assert_array_equal(addon.images.pixels(image), before)
    addon.steps.set_swatch(changed, "pot", 1, (0.75, 0.5, 0.25))
    assert image.is_dirty and not np.array_equal(addon.images.pixels(image), before)
    run_to_end(addon.images._pack_still_images)
    assert not [each.name for each in bpy.data.images if each.is_dirty]


def test_moving_and_removed_pictures_are_not_packed(bpy, addon, changed):
    assert addon.images._pack_still_images() == addon.images.STILL_SECONDS
    assert changed.karf.result.is_dirty
    bpy.data.images.remove(changed.karf.result)
    time.sleep(addon.images.STILL_SECONDS)
    assert addon.images._pack_still_images() is None


def test_renamed_object_keeps_its_tint_also_in_masks(addon, learned, seeing):
    def tints():
        return {item.name: addon.objects.tint(item) for item in objects}

    addon.objects.sync(learned)
    for name in ("zebra", "bowl"):
        addon.steps.add_object(learned, name)
    objects = learned.karf.marking.objects
    before, order = tints(), [name for name in objects.keys() if name in ("lid", "pot")]
    objects["zebra"].name = "can"
    assert tints() == {("can" if name == "zebra" else name): tint for name, tint in before.items()}
    assert len(set(before.values())) == 4
    assert addon.object_masks.in_order(learned, ["pot", "lid", "other"]) == [*order, "other"]
    objects["pot"].number, seeing.show_masks = 5, True
    addon.displayed.of(learned).load_masks()
    masks = addon.displayed.of(learned).known_masks()
    assert masks.tints["pot"] == addon.tints.tint_of(5) == addon.objects.tint(objects["pot"])


def test_tints_of_eight_objects_are_distinct(addon):
    lab = addon.engine_api.srgb_to_lab([addon.tints.tint_of(index) for index in range(8)])
    assert min(addon.engine_api.ciede2000(first, second) for first, second in combinations(lab, 2)) > 15
    assert addon.tints.tint_of(8) == addon.tints.tint_of(0)
