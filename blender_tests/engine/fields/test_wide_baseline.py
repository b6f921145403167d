"""Photos from far apart: what they could all show stays possible, and what hangs before one camera does not."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from blender_tests.engine.reference.still_life import BALL_CENTER, BALL_RADIUS, camera_at, cameras, take_photo
from karf_engine.compute.runtime import start_runtime
from karf_engine.fields.extent import upright_axes
from karf_engine.fields.rendering.rays import PixelDataset
from karf_engine.fields.voxels.fit_box import start_box_fit
from karf_engine.fields.wide_baseline import is_photo_consistent, is_wide_baseline, rotate_about_vertical
from karf_engine.project.settings import GeometrySettings

ORIGIN = torch.zeros(3)


@pytest.fixture(scope="module")
def dataset():
    photos = [take_photo(camera, sky=True) for camera in cameras(12)]
    return PixelDataset([photo.camera for photo in photos], [photo.color.clip(0, 1) for photo in photos], None, None)


def test_twelve_cameras_all_round_stand_far_apart_and_forty_do_not():
    assert is_wide_baseline(cameras(12), ORIGIN)
    assert not is_wide_baseline(cameras(40), ORIGIN)


def test_cameras_along_a_short_path_do_not_stand_far_apart():
    assert not is_wide_baseline([camera_at(0.1 * number, 0.5) for number in range(14)], ORIGIN)
    assert not is_wide_baseline(cameras(2), ORIGIN)


def test_the_surface_of_a_ball_could_be_solid(dataset):
    up = np.random.default_rng(0).normal(size=(300, 3)) * (0.6, 0.6, 0.2) + (
        -0.5,
        0,
        1.5,
    )  # its top, which nothing hides
    surface = BALL_CENTER + BALL_RADIUS * up / np.linalg.norm(up, axis=1, keepdims=True)
    assert is_photo_consistent(dataset, torch.from_numpy(surface).float(), 0.05).float().mean() > 0.9


def test_what_hangs_before_a_camera_could_not(dataset):
    camera = dataset.cameras[0]
    before = torch.from_numpy(0.75 * camera.position).float() + 0.1 * torch.randn(
        300, 3, generator=torch.Generator().manual_seed(0)
    )
    assert is_photo_consistent(dataset, before, 0.05).float().mean() < 0.1


def test_turned_directions_keep_their_elevation_whatever_is_up():
    axes = torch.from_numpy(upright_axes(cameras(12))).float()
    viewdirs = torch.nn.functional.normalize(torch.randn(50, 3, generator=torch.Generator().manual_seed(0)), dim=1)
    result = rotate_about_vertical(viewdirs, axes, torch.linspace(0, 1, 50))
    assert torch.allclose(result @ axes[2], viewdirs @ axes[2], atol=1e-6)
    assert torch.allclose(result.norm(dim=1), torch.ones(50), atol=1e-6)
    assert (result - viewdirs).norm(dim=1).max() > 1


def test_photos_that_agree_nowhere_leave_everything_possible():
    colors = [np.full((32, 32, 3), number / 5) for number in range(6)]  # each of another gray
    dataset, settings = PixelDataset(cameras(6), colors, None, None), GeometrySettings()
    assert start_box_fit(dataset, "opaque", settings, start_runtime(0, 1, "cpu")).field.occupied.all()
