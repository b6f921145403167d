"""A tiny voxel box learns the still life in a few iterations on every kind of background."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.ndimage import maximum_filter

from blender_tests.engine.fields.fitting import pixel_dataset, silent
from blender_tests.engine.reference.still_life import camera_at, cameras, take_photo
from karf_engine.compute.runtime import start_runtime
from karf_engine.errors import Diverged
from karf_engine.fields.extent import focus_point
from karf_engine.fields.voxels import fit_box
from karf_engine.fields.voxels.fit_box import start_box_fit, visual_hull
from karf_engine.metrics.images import psnr
from karf_engine.project.settings import GeometrySettings, Level

SETTINGS = replace(
    GeometrySettings(), levels=(Level(24, 70, 1.0), Level(36, 80, 0.75)), samples=20_000, max_rays=2048, features=6
)


@pytest.fixture(scope="module")
def photos():
    return {sky: [take_photo(camera, sky) for camera in cameras(20)] for sky in (False, True)}


def start(photos, kind, settings=SETTINGS, device="cpu"):
    return start_box_fit(pixel_dataset(photos, kind, device), kind, settings, start_runtime(0, 1, str(device)))


def fit(*arguments, **options):
    return list(start(*arguments, **options).scenes(silent()))[-1]


@pytest.mark.on_device("voxels in a box")
@pytest.mark.parametrize("kind", ["alpha", "black", "opaque"])
def test_held_out_view_is_rendered_well(photos, kind, device):
    sky = kind == "opaque"
    scenes, truth = start(photos[sky], kind, device=device).scenes(silent()), take_photo(camera_at(0.3, 0.6), sky)
    early = next(scenes).render(truth.camera, 1)
    assert early.opacity.mean() > 0.2 and early.opacity[12:20, 12:20].mean() > 0.5
    (scene,) = scenes
    picture = scene.render(truth.camera, 3)
    expected = truth.color + (1 - truth.alpha[..., None]) * (kind == "alpha")
    assert psnr(picture.color.cpu().numpy(), expected) >= 20
    if not sky:
        solid, empty = truth.alpha > 0.99, truth.alpha < 0.01
        opacity = picture.opacity.cpu().numpy()
        assert opacity[solid].mean() > 0.9 and opacity[empty].mean() < 0.1
    # the central pixel shows the scene's center: the camera is 3.6 away, the block reaches 0.75 toward it
    assert 2.6 < picture.depth[16, 16] < 4.2


def test_penalty_clears_fog_of_the_background_color(monkeypatch):
    photos = [take_photo(camera, sky=True) for camera in cameras(40)]  # with few photos the first grid holds no fog
    camera, opacities = camera_at(0.3, 0.6), []
    alpha = take_photo(camera).alpha
    for weight in (fit_box.FOG_PENALTY, 0.0):
        monkeypatch.setattr(fit_box, "FOG_PENALTY", weight)
        opacities.append(fit(photos, "opaque").render(camera, 1).opacity.numpy())
    cleared, foggy = opacities
    assert cleared[alpha < 0.01].mean() < foggy[alpha < 0.01].mean() - 0.02
    assert cleared[alpha > 0.99].mean() > 0.98


@pytest.mark.parametrize("kernels", ["on", "off"])
def test_finished_fit_frees_its_memory(photos, kernels, monkeypatch):
    monkeypatch.setenv("KARF_KERNELS", kernels)
    short = replace(SETTINGS, levels=(Level(16, 30, 1.0), Level(24, 6, 1.0)), samples=8000)
    box_fit = start(photos[True], "opaque", short)
    gc.disable()  # shows reference cycles, which would keep the memory
    try:
        for _ in box_fit.scenes(silent()):
            pass
        box_fit.state()
        moments = [entry["exp_avg"] for entry in box_fit._training_state.optimizer.state.values()]
        parts = [box_fit, box_fit.dataset, box_fit.field, box_fit.background, box_fit.renderer, *moments]
        references = [weakref.ref(part) for part in parts]
        del box_fit, moments, parts, _
        assert not any(reference() is not None for reference in references)
    finally:
        gc.enable()


def test_empty_capture_raises_diverged():
    blank = [replace(take_photo(camera), color=0 * take_photo(camera).color) for camera in cameras(4)]
    short = replace(SETTINGS, levels=(Level(12, 60, 1.0), Level(16, 20, 1.0)), samples=8000, sparsity=1.0)
    with pytest.raises(Diverged, match="nothing solid"):
        fit(blank, "black", short)


def test_focus_point_lies_where_optical_axes_meet():
    assert focus_point(cameras(7)).abs().max() < 1e-5
    assert torch.isfinite(focus_point([camera_at(0, 0)] * 2)).all()


def test_visual_hull_holds_the_scene_and_no_space_seen_empty(photos):
    points = 4 * torch.rand(4000, 3, generator=torch.Generator().manual_seed(0)) - 2
    hull = visual_hull(pixel_dataset(photos[False], "alpha"), points, 0.05).numpy()
    ball = (points - torch.tensor([-0.4, 0.0, 0.1])).norm(dim=1) < 0.42
    assert ball.sum() > 5 and hull[ball].all()
    for photo in photos[False]:
        pixels, _ = photo.camera.project(points.double().numpy())
        u, v = np.floor(pixels).astype(int).T
        inside = (u >= 0) & (u < 32) & (v >= 0) & (v < 32)
        near_object = maximum_filter(photo.alpha, 5)[v.clip(0, 31), u.clip(0, 31)] > 0
        assert not hull[inside & ~near_object].any()
    assert 0.005 < hull.mean() < 0.1


def test_visual_hull_holds_objects_wider_than_a_photo(photos):
    narrow = [replace(photo.camera, fx=2.5 * photo.camera.fx, fy=2.5 * photo.camera.fy) for photo in photos[False]]
    slab = torch.rand(500, 3, generator=torch.Generator().manual_seed(0)) * torch.tensor([1.9, 1.5, 0.1])
    slab -= torch.tensor([0.95, 0.75, 0.43])
    pixels = np.stack([camera.project(slab.double().numpy())[0] for camera in narrow])
    share = ((pixels > 0) & (pixels < 32)).all(2).mean(0)
    rim = (share > 0.3) & (share < 0.5)
    assert rim.sum() > 20
    assert visual_hull(pixel_dataset([take_photo(camera) for camera in narrow], "alpha"), slab, 0.1)[rim].all()
