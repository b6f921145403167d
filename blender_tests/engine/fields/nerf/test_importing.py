"""Where a foreign NeRF's world lies: the candidate alignments are those that LLFF's and NeRF's own loaders make."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")

from blender_tests.engine.reference.nerf import still_life
from karf_engine.capture.capture import View
from karf_engine.fields.nerf.importing import candidate_alignments
from karf_engine.fields.rendering.rays import camera_rays
from karf_engine.project.settings import NerfSettings

BOUNDS = (1.2, 30.0)
CORNERS = torch.tensor([0, 31, 32 * 23, 32 * 24 - 1])


def views():
    """Views with depth bounds, off the origin."""
    found = []
    for view in still_life(9)[0]:
        pose = view.camera.camera_to_world.copy()
        pose[:3, 3] += (3.0, -1.0, 0.5)
        found.append(replace(view, camera=replace(view.camera, camera_to_world=pose), depth_bounds=BOUNDS))
    return found


def aligned(name, of=None, settings=None):
    return {p.name: p for p in candidate_alignments(of or views(), settings or NerfSettings())}[name]


def unit(v):
    return v / np.linalg.norm(v)


def recentered(poses):
    """LLFF's recentering of poses [n, 4, 4], scaled so that the nearest depth becomes 1 / 0.75."""
    scaled = poses.copy()
    scaled[:, :3, 3] /= 0.75 * BOUNDS[0]
    z = unit(scaled[:, :3, 2].sum(0))
    x = unit(np.cross(scaled[:, :3, 1].sum(0), z))
    middle = np.eye(4)
    middle[:3] = np.stack([x, np.cross(z, x), z, scaled[:, :3, 3].mean(0)], 1)
    return np.linalg.inv(middle) @ scaled


def spherified(poses):
    """LLFF's spherical alignment of recentered poses."""
    origins, axes = poses[:, :3, 3:], poses[:, :3, 2:3]
    projectors = np.eye(3) - axes * axes.transpose(0, 2, 1)
    center = np.linalg.solve(projectors.mean(0), (projectors @ origins).mean(0))[:, 0]
    up = unit((poses[:, :3, 3] - center).mean(0))
    right = unit(np.cross([0.1, 0.2, 0.3], up))
    middle = np.eye(4)
    middle[:3] = np.stack([right, np.cross(up, right), up, center], 1)
    result = np.linalg.inv(middle) @ poses
    result[:, :3, 3] /= np.sqrt((result[:, :3, 3] ** 2).sum(1).mean())
    return result


@pytest.mark.parametrize(("name", "reference"), [("LLFF recentered", recentered), ("LLFF spherified", spherified)])
def test_cameras_lie_where_llffs_loader_puts_them(name, reference):
    poses = np.stack([view.camera.camera_to_world for view in views()])
    expected = reference(recentered(poses) if reference is spherified else poses)
    space = aligned(name).space
    for view, pose in zip(views(), expected, strict=True):
        rays = camera_rays(view.camera)[CORNERS]
        origins, directions = space.to_grid_rays(rays)
        assert_allclose(origins, np.tile(pose[:3, 3], (4, 1)), atol=1e-4)
        moved = replace(view.camera, camera_to_world=pose)
        assert_allclose(space.rotate_directions(rays.viewdirs), camera_rays(moved)[CORNERS].viewdirs, atol=1e-5)
        lengths = torch.linalg.norm(directions, dim=1)
        assert_allclose(lengths, lengths.mean().expand(4), rtol=1e-5)


def test_depths_are_scaled_with_the_world():
    for name in ("LLFF recentered", "LLFF spherified", "as it is, LLFF's bounds"):
        assert (aligned(name).near, aligned(name).far) == pytest.approx((0.9 * BOUNDS[0], BOUNDS[1]))
    scaled = aligned("scaled")
    _, directions = scaled.space.to_grid_rays(camera_rays(views()[0].camera)[CORNERS])
    length = float(torch.linalg.norm(directions[0]))
    assert (scaled.near * length, scaled.far * length) == pytest.approx((2, 6), rel=1e-5)


def test_ndc_is_that_of_the_recentered_poses():
    """NeRF, appendix C, with the near plane at 1 after scaling."""
    poses = recentered(np.stack([view.camera.camera_to_world for view in front()]))
    space = aligned("LLFF in NDC", front()).space
    for view, pose in zip(front(), poses, strict=True):
        camera = view.camera
        first, step = space.to_grid_rays(camera_rays(camera)[CORNERS])
        rays = camera_rays(replace(camera, camera_to_world=pose))[CORNERS]
        origins, directions = rays.origins.double().numpy(), rays.viewdirs.double().numpy()
        origins = origins - ((1 + origins[:, 2]) / directions[:, 2])[:, None] * directions
        ox, oy, oz = origins.T
        dx, dy, dz = directions.T
        ax, ay = -2 * camera.fx / camera.width, -2 * camera.fy / camera.height
        assert_allclose(first, np.stack([ax * ox / oz, ay * oy / oz, 1 + 2 / oz], 1), atol=1e-4)
        expected = np.stack([ax * (dx / dz - ox / oz), ay * (dy / dz - oy / oz), -2 / oz], 1)
        assert_allclose(step, expected, atol=1e-4)
        # in between the ray's own points lie on that line
        along = torch.from_numpy(camera.camera_to_world[:3, 3]).float() + 7.0 * camera_rays(camera)[CORNERS].viewdirs
        offset = space.to_grid(along) - first
        assert_allclose(torch.linalg.cross(offset, step), np.zeros((4, 3)), atol=1e-4)


def front():
    """Three cameras side by side that look along -z."""
    camera = replace(still_life(1)[0][0].camera, width=32, height=24)
    found = []
    for n in range(3):
        pose = np.eye(4)
        pose[:3, 3] = (0.4 * n, 0.1 * n, 0.05 * n)
        found.append(View(f"v{n}", f"v{n}", replace(camera, camera_to_world=pose), None, "train", BOUNDS))
    return found


def test_without_depth_bounds_the_ways_of_llff_are_not_tried_and_a_range_can_be_set():
    plain = [replace(view, depth_bounds=None) for view in views()]
    names = [p.name for p in candidate_alignments(plain, NerfSettings(near=0.5, far=3.0))]
    assert names == ["as it is, near and far as set", "as it is, near 2 and far 6", "scaled"]
    assert aligned("as it is, near and far as set", plain, NerfSettings(near=0.5, far=3.0)).far == 3.0
