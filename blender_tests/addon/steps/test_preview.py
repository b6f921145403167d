"""Live Camera: the picture refines from coarse to full and follows camera, rig and swatches."""

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ..timers import pretend_window

SIDES = [96, 100, 200]  # coarse, half, full
GREEN = (0.8, 0.6, 0.1)  # the pot's red, greener by 0.4


def run_until(addon, is_done):
    """Run the timers of the preview and of the engine."""
    deadline = time.monotonic() + 20
    while not is_done():
        addon.preview._tick()
        addon.queries._poll()
        assert time.monotonic() < deadline, addon.preview.message()
        time.sleep(0.01)


@pytest.fixture
def live(bpy, addon, learned, image_editor, seeing, monkeypatch):
    """Live Camera in a window. `look(n)` runs all timers until n pictures arrive, `tick()` only the preview's."""
    learned.render.resolution_x, learned.render.resolution_y = 300, 150
    bpy.context.window_manager.karf_preview.long_side = SIDES[-1]
    pretend_window(bpy, monkeypatch, addon.preview, addon.queries, addon.session)
    sides, take = [], addon.preview._take

    def taking(asked, scene, answer):
        sides.append(asked[1])
        take(asked, scene, answer)

    def look(count):
        known = len(sides)
        run_until(addon, lambda: len(sides) >= known + count)
        return sides[known:]

    def tick():
        for _ in range(5):
            addon.preview._tick()
        return not addon.queries.is_waiting("preview")

    monkeypatch.setattr(addon.preview, "_take", taking)
    addon.preview.start(learned)
    pot, editor = learned.karf.objects["pot"].swatches[1], image_editor.spaces.active
    return SimpleNamespace(look=look, tick=tick, scene=learned, pot=pot, editor=editor, seeing=seeing)


def picture(bpy, addon):
    return addon.images.pixels(bpy.data.images["KaRF camera"])[..., :3] * 255


def test_picture_refines_from_coarse_to_full_and_stops(bpy, addon, live):
    found = []
    for _ in SIDES:
        found += live.look(1)
        assert tuple(bpy.data.images["KaRF camera"].size) == (200, 100)
    assert found == SIDES and live.tick()
    jobs = addon.folders.project_of(live.scene).folder / "jobs"
    assert list(jobs.glob("*-warm/answers/*")) == []  # read and removed


def test_picture_follows_camera_rig_and_swatches(bpy, addon, live):
    live.look(3)
    before = picture(bpy, addon)
    live.scene.camera.location *= 0.5
    assert live.look(3) == SIDES
    assert np.allclose(picture(bpy, addon), before / 2, atol=1)
    # the rig moves away from a camera outside of it
    matrix = live.scene.camera.matrix_world.copy()
    live.scene.camera.parent, live.scene.camera.matrix_world = None, matrix
    live.scene.karf.rig.location.x += 5
    live.look(3)
    assert picture(bpy, addon).mean() > before.mean()
    addon.queries.stop()
    before = picture(bpy, addon)
    live.pot.color = GREEN
    addon.preview._tick()
    assert addon.session.get(addon.queries.QueryWorker).worker is None
    assert np.allclose(picture(bpy, addon) - before, [0, 0.4 * 0.25 * 255, 0], atol=1.5)


def test_hidden_picture_waits_and_removed_picture_returns(bpy, addon, live):
    live.look(3)
    live.editor.image = bpy.data.images.new("another", 8, 8)
    live.scene.camera.location *= 0.5
    assert live.tick()
    assert "The picture KaRF camera is only rendered while an Image Editor shows it" in addon.preview.message()
    live.editor.image = bpy.data.images["KaRF camera"]
    assert live.look(3) == SIDES
    assert addon.preview.message() == ""
    before = picture(bpy, addon)
    bpy.data.images.remove(bpy.data.images["KaRF camera"])  # as undo does
    addon.preview._tick()
    assert live.editor.image == bpy.data.images["KaRF camera"]
    assert np.array_equal(picture(bpy, addon), before)


def test_display_modes_apply_to_the_camera_picture(bpy, addon, live):
    def shown():
        addon.preview._tick()
        return picture(bpy, addon)

    live.look(3)
    learned, seeing = picture(bpy, addon), live.seeing
    live.pot.color = GREEN
    edited = shown()
    for mode, expected in (("ORIGINAL", learned), ("LEARNED", learned), ("EDITED", edited)):
        seeing.mode = mode
        assert np.array_equal(shown(), expected), mode
    seeing.is_wiped, seeing.wipe = True, 0.25
    assert np.array_equal(shown(), np.hstack([learned[:, :50], edited[:, 50:]]))
    seeing.is_wiped = False
    bpy.ops.karf.solo_swatch(object_name="pot", index=1)
    assert np.allclose(shown(), 0.25 * 255, atol=1)  # the swatch has a weight of 1/4 in every pixel
    seeing.mode = "DIFFERENCE"
    assert (shown() > addon.views.heat(np.zeros(1))[0] * 255 + 1).any()


def test_masks_overlay_the_picture_while_the_camera_is_live(addon, live):
    live.look(3)
    assert addon.displayed.followed_camera().masks is None
    live.seeing.show_masks = True
    addon.preview._tick()
    masks = addon.displayed.followed_camera().masks
    assert list(masks.tints) == ["lid", "pot"] and masks.fill.shape == (100, 200, 4)
    assert addon.displayed.is_camera_in(live.editor)
    addon.preview.stop()
    assert addon.displayed.followed_camera() is None and not addon.displayed.is_camera_in(live.editor)


def test_unavailable_parts_of_the_picture_are_explained(bpy, addon, live, monkeypatch):
    live.look(3)
    assert addon.preview.missing() == ()
    live.seeing.mode = "ORIGINAL"
    assert addon.preview.missing() == (addon.preview.NO_PHOTO,)
    taken = addon.preview._taken

    def unlearned(answer):
        view = taken(answer)
        none = {"objects": (), "palette_weights": view.planes.palette_weights[:0, :0]}
        return replace(view, planes=replace(view.planes, probabilities=view.planes.probabilities[:0], **none))

    monkeypatch.setattr(addon.preview, "_taken", unlearned)
    live.scene.camera.location.x += 0.1
    live.seeing.mode, live.seeing.show_masks = "WEIGHTS", True
    live.look(3)
    assert addon.preview.missing() == (addon.preview.NO_PALETTES, addon.preview.NO_MASKS)
    assert np.ptp(picture(bpy, addon)) == 0  # the fake scene as learned is uniform


def test_errors_are_reported_and_the_next_camera_is_tried(addon, live, monkeypatch):
    options = addon.preview._options
    monkeypatch.setattr(addon.preview, "_options", lambda *camera: options(*camera) | {"behave": "crash"})
    run_until(addon, lambda: "crashed" in addon.preview.message())
    assert live.tick()
    monkeypatch.setattr(addon.preview, "_options", options)
    live.scene.camera.location.x += 0.1
    live.look(1)
    assert addon.preview.message() == ""
    live.scene.camera.data.type = "ORTHO"
    addon.preview._tick()
    assert "is not a perspective camera" in addon.preview.message()
    live.scene.camera.data.type = "PERSP"
    live.look(1)
    assert addon.preview.message() == ""


def test_picture_is_packed_and_live_camera_ends_with_its_project(bpy, addon, live, tmp_path):
    live.look(1)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert bpy.data.images["KaRF camera"].packed_file is not None
    live.scene.karf.project = str(tmp_path / "elsewhere")
    assert addon.preview._tick() is None and not addon.preview.is_live()


def test_script_writes_the_preview_and_live_camera_needs_a_window(bpy, addon, learned, tmp_path):
    with pytest.raises(RuntimeError, match="needs a window"):
        bpy.ops.karf.live_camera()
    learned.render.resolution_x, learned.render.resolution_y = 300, 150
    addon.steps.set_swatch(learned, "pot", 1, GREEN)
    path = addon.steps.preview_camera(learned, tmp_path / "out" / "seen.png", long_side=100)
    seen = addon.images.read_picture(path)
    assert seen.shape == (50, 100, 3) and seen[..., 1].mean() - seen[..., 0].mean() == pytest.approx(0.1, abs=0.01)


def test_enlarged_picture_keeps_its_ramp(addon):
    ramp = np.linspace(0, 1, 10, dtype=np.float32)
    large = addon.images.enlarged(np.broadcast_to(ramp[None, :, None], (4, 10, 4)), 40, 8)
    assert large.shape == (8, 40, 4)
    assert np.allclose(np.diff(large[0, 4:-4, 0]), 1 / 36, atol=1e-5) and large.max() <= 1
