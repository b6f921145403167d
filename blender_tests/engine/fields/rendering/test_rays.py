"""Rays of pixels: a dataset of many training images hands out the same rays as each camera."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

torch = pytest.importorskip("torch")

from karf_engine.capture.camera import Camera
from karf_engine.capture.distortion import distort
from karf_engine.fields.rendering.rays import PixelDataset, camera_rays, depth_per_distance, spherical_harmonics


def random_camera(seed, width, height):
    random = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3] = rotation * np.sign(np.linalg.det(rotation))
    pose[:3, 3] = random.normal(size=3) * 4
    return Camera(width, height, 1.3 * width, 1.1 * width, 0.45 * width, 0.6 * height, pose)


CAMERAS = [random_camera(0, 7, 5), random_camera(1, 4, 9), random_camera(2, 6, 6)]


def random_bank(with_alpha=False):
    random = np.random.default_rng(3)
    colors = [random.random((c.height, c.width, 3)) for c in CAMERAS]
    alphas = [random.random((c.height, c.width)) for c in CAMERAS] if with_alpha else None
    return PixelDataset(CAMERAS, colors, alphas), colors, alphas


def test_rays_of_the_bank_are_those_of_the_cameras():
    dataset, _, _ = random_bank()
    rays = dataset.rays(torch.arange(len(dataset)))
    expected = [camera.rays(camera.pixel_centers()) for camera in CAMERAS]
    directions = np.concatenate([d / np.linalg.norm(d, axis=1, keepdims=True) for _, d in expected])
    assert_allclose(rays.origins, np.concatenate([o for o, _ in expected]), atol=1e-6)
    assert_allclose(rays.viewdirs, directions, atol=1e-6)


def test_pixels_of_plates_of_mixed_sizes_are_found_in_any_order():
    dataset, colors, alphas = random_bank(with_alpha=True)
    assert len(dataset) == 7 * 5 + 4 * 9 + 6 * 6
    assert dataset.offsets.tolist() == [0, 35, 71, 107]
    index = torch.tensor([70, 0, 106, 35, 34, 71])
    assert dataset.view_indices(index).tolist() == [1, 0, 2, 1, 0, 2]
    whole = torch.arange(len(dataset))
    assert_allclose(dataset.rays(index).viewdirs, dataset.rays(whole).viewdirs[index])
    # the last pixel of the second training image is its lower right corner
    assert_array_equal(dataset.color[70], np.rint(colors[1][8, 3] * 255))
    assert dataset.alpha[70] == np.rint(alphas[1][8, 3] * 255)


def test_camera_rays_are_unit_and_run_row_by_row():
    rays = camera_rays(CAMERAS[0])
    dataset, _, _ = random_bank()
    assert_allclose(rays.viewdirs.norm(dim=1), np.ones(35), atol=1e-6)
    assert_allclose(rays.viewdirs, dataset.rays(torch.arange(35)).viewdirs, atol=1e-6)


def test_depth_along_the_axis_follows_from_distance_along_the_ray():
    camera = CAMERAS[1]
    rays = camera_rays(camera)
    points = rays.origins.double().numpy() + 2.5 * rays.viewdirs.double().numpy()
    _, depth = camera.project(points)
    assert_allclose(2.5 * depth_per_distance(camera), depth, rtol=1e-6)


def test_rays_of_a_lens_are_those_of_the_photo_as_stored():
    camera = Camera(16, 12, 13.0, 12.0, 8.3, 5.7, random_camera(5, 4, 4).camera_to_world, (-0.2, 0.05, 0.01, -0.01))
    rays, factors = camera_rays(camera), depth_per_distance(camera)
    points = rays.origins.numpy() + rays.viewdirs.numpy() * (3 / factors)[:, None]
    pixels, depth = camera.without_distortion().project(points.astype(np.float64))
    assert_allclose(distort(camera, pixels), camera.pixel_centers(), atol=1e-3)
    assert_allclose(depth, 3, atol=1e-5)


def test_spherical_harmonics_are_orthonormal_over_the_sphere():
    directions = torch.nn.functional.normalize(
        torch.randn(200_000, 3, generator=torch.Generator().manual_seed(0)), dim=1
    )
    basis = spherical_harmonics(directions)
    assert_allclose(4 * np.pi * (basis.T @ basis) / len(basis), np.eye(9), atol=0.02)
