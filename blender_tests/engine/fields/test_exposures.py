"""Exposure gains follow from places seen in several photos; gloss and equal exposures give none."""

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
EQUAL = np.ones((24, 3))


def floor_of(camera):
    """Where each pixel shows the floor z = 0: depth, whether it is seen, position."""
    origins, directions = camera.rays(camera.pixel_centers())
    is_seen = directions[:, 2] < -0.1
    depth = np.where(is_seen, -origins[:, 2] / np.where(is_seen, directions[:, 2], -1), 0)
    return depth, is_seen, origins + depth[:, None] * directions


class Floor:
    def render(self, camera, _):
        depth, is_seen = (torch.from_numpy(each.reshape(48, 48)) for each in floor_of(camera)[:2])
        return SimpleNamespace(depth=depth, opacity=is_seen.float())


def take_photos(gains):
    """Photos of a floor in soft patches, each with one gain or one for each of its pixels."""
    photos = []
    for camera, gain in zip(CAMERAS, gains, strict=True):
        x, y, _ = floor_of(camera)[2].T
        color = 0.4 + 0.15 * np.stack([np.sin(2 * x + y), np.sin(x - 2 * y), np.cos(2 * x)], 1)
        photos.append((color * gain).reshape(48, 48, 3))
    return PixelDataset(CAMERAS, photos, None)


def test_gains_are_estimated_with_a_geometric_mean_of_1():
    found = np.log(estimate_photo_gains(Floor(), take_photos(np.exp(LOGS))))
    np.testing.assert_allclose(found.mean(0), 0, atol=1e-6)
    assert np.abs(found - LOGS).mean() < 0.01


def test_gains_of_held_out_photos_come_from_the_rendered_scene():
    colors, gains = take_photos(EQUAL).image(3), (0.8, 1.0, 1.3)
    picture = Floor().render(CAMERAS[3], 1)
    picture.color = torch.from_numpy(colors)
    scene = SimpleNamespace(render=lambda camera, _: picture)
    assert gains_from_render(scene, CAMERAS[3], colors * gains) == pytest.approx(gains, abs=0.01)
    picture.opacity = torch.zeros(48, 48)
    assert gains_from_render(scene, CAMERAS[3], colors * gains) == (1.0, 1.0, 1.0)


GLOSS = np.array([[0.1 * camera.position[0] / 3.6] * 3 for camera in CAMERAS])
OPPOSITE_HALVES = [
    np.exp(logs * np.where(floor_of(camera)[2][:, :1] > 0, 1, -1)) for camera, logs in zip(CAMERAS, LOGS, strict=True)
]


@pytest.mark.parametrize(
    ("gains", "count", "has_surface"),
    [
        (EQUAL, 24, True),
        (np.exp(GLOSS), 24, True),
        (OPPOSITE_HALVES, 24, True),
        (np.exp(LOGS), 5, True),
        (np.exp(LOGS), 24, False),
    ],
    ids=["equal exposures", "gloss by direction", "halves disagree", "few photos", "no surface"],
)
def test_gains_are_exactly_1_without_evidence(gains, count, has_surface):
    dataset, zeros = take_photos(gains), torch.zeros(48, 48)
    dataset = PixelDataset(CAMERAS[:count], [dataset.image(n) for n in range(count)], None)
    empty = SimpleNamespace(render=lambda camera, _: SimpleNamespace(depth=zeros, opacity=zeros))
    assert (estimate_photo_gains(Floor() if has_surface else empty, dataset) == 1).all()


def test_gains_of_1_leave_pixels_unchanged():
    dataset = take_photos(EQUAL)
    pixels = torch.tensor([0, int(dataset.offsets[1])])
    colors = dataset.color[pixels].float() / 255
    assert torch.equal(dataset.normalized_colors(pixels), colors)
    dataset.gains[1] = torch.tensor([2.0, 1.0, 0.5])
    assert torch.equal(dataset.normalized_colors(pixels)[1], colors[1] / torch.tensor([2.0, 1.0, 0.5]))


def test_later_levels_learn_from_normalized_exposures(monkeypatch):
    photos = [take_photo(camera, sky=True) for camera in cameras(12)]
    settings = replace(box.SETTINGS, levels=(*box.SETTINGS.levels, Level(36, 60, 0.75)))
    gains = np.full((12, 3), 1.25, np.float32)
    monkeypatch.setattr(voxel_fit, "estimate_photo_gains", lambda *_: gains)
    fit, other = (box.start(photos, "opaque", settings) for _ in range(2))
    scenes = fit.scenes(silent())
    next(scenes)
    assert fit.gains == np.ones((12, 3)).tolist()
    before = next(scenes).render(photos[0].camera, 1).color.mean()
    assert fit.gains == gains.tolist()
    other.resume(fit.state())
    assert other.gains == gains.tolist()
    after = next(scenes).render(photos[0].camera, 1).color.mean()
    assert after / before == pytest.approx(1 / 1.25, abs=0.05)
