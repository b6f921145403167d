"""Exposures of photos are told by places that several show; gloss is none, and photos that agree stay as they are."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from blender_tests.engine.fields.fitting import silent
from blender_tests.engine.fields.voxels import test_fit as box
from blender_tests.engine.reference.still_life import cameras, take_photo
from karf_engine.fields.exposures import estimate_photo_gains, gains_from_render
from karf_engine.fields.rendering.rays import PixelDataset
from karf_engine.fields.voxels import fit as voxel_fit
from karf_engine.project.settings import Level

CAMERAS = cameras(24, 48)
RANDOM = np.random.default_rng(5)
LOGS = RANDOM.normal(0, 0.08, (24, 1)) + RANDOM.normal(0, 0.04, (24, 1)) * (1, 0, -1)
LOGS -= LOGS.mean(0)
ALIKE = np.ones((24, 3))


def depth_of_floor(camera):
    """Depth of the floor z = 0, and where it is seen."""
    origins, directions = camera.rays(camera.pixel_centers())
    is_seen = directions[:, 2] < -0.1
    return np.where(is_seen, -origins[:, 2] / np.where(is_seen, directions[:, 2], -1), 0), is_seen


class Floor:
    def render(self, camera, _):
        shape = (camera.height, camera.width)
        depth, is_seen = (torch.from_numpy(each.reshape(shape)) for each in depth_of_floor(camera))
        return SimpleNamespace(depth=depth, opacity=is_seen.float())


def photographed(gains):
    """Photos of a floor in soft patches, each with a gain of its own or one for each of its pixels."""
    photos = []
    for camera, gain in zip(CAMERAS, gains, strict=True):
        origins, directions = camera.rays(camera.pixel_centers())
        x, y, _ = (origins + depth_of_floor(camera)[0][:, None] * directions).T
        color = 0.4 + 0.15 * np.stack([np.sin(2 * x + y), np.sin(x - 2 * y), np.cos(2 * x)], 1)
        photos.append((color * gain).reshape(camera.height, camera.width, 3))
    return PixelDataset(CAMERAS, photos, None)


def test_gains_are_found_and_their_geometric_mean_is_1():
    found = np.log(estimate_photo_gains(Floor(), photographed(np.exp(LOGS))))
    np.testing.assert_allclose(found.mean(0), 0, atol=1e-6)
    assert np.abs(found - LOGS).mean() < 0.01


def test_gains_of_an_unlearned_photo_come_from_the_rendered_scene():
    colors, gains = photographed(ALIKE).image(3), (0.8, 1.0, 1.3)
    shown = Floor().render(CAMERAS[3], 1)
    scene = SimpleNamespace(render=lambda camera, _: SimpleNamespace(color=torch.from_numpy(colors), **vars(shown)))
    assert gains_from_render(scene, CAMERAS[3], colors * gains) == pytest.approx(gains, abs=0.01)
    shown.opacity = torch.zeros(48, 48)
    assert gains_from_render(scene, CAMERAS[3], colors * gains) == (1.0, 1.0, 1.0)


def one_half_of_the_world_tells():
    gains = []
    for camera, logs in zip(CAMERAS, LOGS, strict=True):
        origins, directions = camera.rays(camera.pixel_centers())
        places = origins + depth_of_floor(camera)[0][:, None] * directions
        gains.append(np.exp(logs * np.where(places[:, :1] > 0, 1, -1)))
    return gains


SHINE = np.array([[0.1 * camera.position[0] / 3.6] * 3 for camera in CAMERAS])


@pytest.mark.parametrize(
    ("gains", "count", "has_surface"),
    [
        (ALIKE, 24, True),
        (np.exp(SHINE), 24, True),
        (one_half_of_the_world_tells(), 24, True),
        (np.exp(LOGS), 5, True),
        (np.exp(LOGS), 24, False),
    ],
    ids=["exposed alike", "gloss that follows the direction", "half of the world", "few photos", "no surface"],
)
def test_gains_are_exactly_1_without_evidence(gains, count, has_surface):
    dataset, nothing = photographed(gains), torch.zeros(48, 48)
    dataset = PixelDataset(CAMERAS[:count], [dataset.image(n) for n in range(count)], None)
    empty = SimpleNamespace(render=lambda camera, _: SimpleNamespace(depth=nothing, opacity=nothing))
    assert (estimate_photo_gains(Floor() if has_surface else empty, dataset) == 1).all()


def test_gains_of_1_keep_every_bit_of_a_pixel():
    dataset = photographed(ALIKE)
    pixels = torch.tensor([0, int(dataset.offsets[1])])
    as_photographed = dataset.color[pixels].float() / 255
    assert torch.equal(dataset.normalized_colors(pixels), as_photographed)
    dataset.gains[1] = torch.tensor([2.0, 1.0, 0.5])
    assert torch.equal(dataset.normalized_colors(pixels)[1], as_photographed[1] / torch.tensor([2.0, 1.0, 0.5]))


def test_later_levels_learn_from_photos_of_one_exposure(monkeypatch):
    photos = [take_photo(camera, sky=True) for camera in cameras(12)]
    settings = replace(box.SETTINGS, levels=(*box.SETTINGS.levels, Level(36, 60, 0.75)))
    told = np.full((12, 3), 1.25, np.float32)
    monkeypatch.setattr(voxel_fit, "estimate_photo_gains", lambda *_: told)

    fit, other = (box.start(photos, "opaque", settings) for _ in range(2))
    scenes = fit.scenes(silent())
    next(scenes)
    assert fit.gains == np.ones((12, 3)).tolist()
    before = next(scenes).render(photos[0].camera, 1).color.mean()
    assert fit.gains == told.tolist()
    other.resume(fit.state())
    assert other.gains == told.tolist()
    after = next(scenes).render(photos[0].camera, 1).color.mean()
    assert after / before == pytest.approx(1 / 1.25, abs=0.05)
