"""Where the sky begins, and whether photos agree on it."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from blender_tests.engine.reference.still_life import camera_at
from karf_engine.capture.capture import SparsePoints
from karf_engine.compute.runtime import start_runtime
from karf_engine.fields.horizon import estimate_horizon
from karf_engine.fields.rendering.rays import PixelDataset, camera_rays
from karf_engine.fields.voxels.fit_open import fit_sky

LOW = [camera_at(2 * np.pi * n / 8, 0.1) for n in range(8)]  # half of their pictures is above the horizontal


def points_at(positions):
    """Points that all cameras observe."""
    count = len(positions)
    view, point = np.divmod(np.arange(len(LOW) * count), count)
    return SparsePoints(
        np.array(positions, float),
        np.zeros((count, 3), np.uint8),
        np.full(count, 0.3, np.float32),
        view.astype(np.int32),
        point.astype(np.int32),
        np.zeros((len(view), 2), np.float32),
    )


def horizon(*positions):
    return estimate_horizon(LOW, points_at(positions) if positions else None, torch.zeros(3), 2.0)


def toward(azimuth, elevation):
    """A unit direction, angles in degrees."""
    azimuth, elevation = np.radians([azimuth, elevation])
    across = np.cos(elevation)
    return torch.tensor([[across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)]], dtype=torch.float32)


def bank_of(color_of):
    """Photos, two in each direction, whose colors are a function of the rays."""
    cameras = LOW + [camera_at(2 * np.pi * n / 8, 0.1, distance=5.0) for n in range(8)]
    return PixelDataset(cameras, [color_of(camera_rays(camera)).view(32, 32, 3).numpy() for camera in cameras], None)


def gradient(rays):
    return 0.5 + 0.4 * rays.viewdirs


def test_the_sky_begins_above_the_horizontal():
    assert horizon().is_sky(toward(50, 3)).all() and not horizon().is_sky(toward(50, -3)).any()


def test_what_stands_far_away_hides_the_sky_behind_it_and_nowhere_else():
    hill = horizon((60.0, 0.0, 15.0))  # 14 degrees above the horizontal
    assert not hill.is_sky(toward(0, 10)).any() and hill.is_sky(toward(0, 20)).all()
    assert hill.is_sky(toward(180, 10)).all()


def test_what_the_cameras_stand_round_hides_no_sky():
    assert horizon((0.0, 0.0, 1.8)).is_sky(toward(0, 10)).all()


def test_a_sky_is_learned_though_things_stand_before_it():
    random = torch.Generator().manual_seed(0)

    def partly_hidden(rays):
        hidden = torch.rand(len(rays), 1, generator=random) < 0.15
        return torch.where(hidden, torch.tensor([0.9, 0.1, 0.1]), gradient(rays))

    sky = fit_sky(bank_of(partly_hidden), horizon(), start_runtime(0, 1, "cpu"))
    rays = camera_rays(LOW[3])
    above = horizon().is_sky(rays.viewdirs)
    assert (sky(rays.viewdirs) - gradient(rays))[above].abs().mean() < 0.05


def test_what_differs_from_camera_to_camera_is_no_sky():
    near_wall = bank_of(lambda rays: 0.5 + 0.5 * torch.sin(6 * rays.origins))
    assert fit_sky(near_wall, horizon(), start_runtime(0, 1, "cpu")) is None
