"""Initial Gaussians on the surface of a learned scene, and pseudo cameras between sparse photos."""

from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

pytest.importorskip("numba")

from blender_tests.engine.reference.still_life import BALL_CENTER, BALL_RADIUS, BOXES, camera_at
from blender_tests.engine.splats.clouds import GROUPS
from blender_tests.engine.splats.torch_splats import rotations
from karf_engine.capture.camera import Camera
from karf_engine.errors import Cancelled
from karf_engine.metrics.images import psnr
from karf_engine.recolor.model import Model
from karf_engine.splats import start
from karf_engine.splats.gaussians import Gaussians
from karf_engine.splats.kernels.arrays import COLOR, LOG_SCALE, ROTATION
from karf_engine.splats.rasterizer import rasterize

MIDDLE = np.array([1.0, 2.0, 0.5])


@pytest.fixture(scope="module")
def model(learned):
    return Model.load(learned.project, "cpu")


@pytest.fixture(scope="module")
def begun(model):
    return start.initial_gaussians(model.scene, model.capture.split("train"), 3000, 1)


def distances_to_surface(points):
    """Distances [n] of points [n, 3] to the surfaces of the still life."""
    found = [np.abs(np.linalg.norm(points - BALL_CENTER, axis=1) - BALL_RADIUS)]
    for low, high in BOXES.values():
        middle, half = (np.add(low, high)) / 2, np.subtract(high, low) / 2
        beyond = np.abs(points - middle) - half
        outside, inside = np.linalg.norm(beyond.clip(0), axis=1), beyond.max(1).clip(max=0)
        found.append(np.abs(outside + inside))
    return np.min(found, 0)


def axes_of(table):
    return rotations(torch.from_numpy(table[:, ROTATION : ROTATION + 4]).double()).numpy()


def test_initial_disks_lie_flat_on_the_surface(begun):
    table = begun.table[: begun.n_foreground]
    voxel, distances = 2.2 / 36, distances_to_surface(table[:, :3])
    assert np.median(distances) < voxel and np.quantile(distances, 0.9) < 3 * voxel
    assert 1500 < begun.n_foreground < 6000 and begun.degree == 1
    ball = np.linalg.norm(table[:, :3] - BALL_CENTER, axis=1) < BALL_RADIUS + 0.05
    outward = table[ball, :3] - BALL_CENTER
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert np.median((outward * axes_of(table[ball])[:, :, 2]).sum(1)) > 0.9
    scales = np.exp(table[:, LOG_SCALE : LOG_SCALE + 3])
    assert_allclose(scales[:, 0], scales[:, 1])
    assert (scales[:, 2] < 0.5 * scales[:, 0]).all()


def test_initial_picture_resembles_the_field(model, begun):
    camera = model.working_camera(model.capture.split("test")[0])
    shown = rasterize(begun, camera).image[..., :3].clip(0, 1)
    assert psnr(shown, model.render_field(camera).color) > 18
    assert (begun.table[:, COLOR + 3 :] == 0).all() and begun.table[:, GROUPS["color"]].any()
    assert begun.n_background == 0 and begun.background == (0, 0, 0), "a plain background needs no Gaussians"
    eyes = [view.camera.position for view in model.capture.views]
    nearest = min(np.linalg.norm(begun.table[:, :3] - eye, axis=1).min() for eye in eyes)
    assert 0 < begun.near < nearest


def test_learned_background_becomes_a_distant_shell_of_its_colors(model):
    def sky(viewdirs):
        return 0.5 + 0.4 * viewdirs

    views = model.capture.split("train")
    gaussians = start.initial_gaussians(replace(model.scene, background=sky), views, 1000, 0)
    shell = gaussians.table[gaussians.n_foreground :]
    assert len(shell) == start.BEHIND
    eyes = np.stack([view.camera.position for view in views])
    assert np.linalg.norm(shell[:, :3], axis=1).min() > 5 * np.linalg.norm(eyes, axis=1).max()
    camera = views[0].camera
    seen = rasterize(replace(gaussians, table=shell), camera).image
    assert seen[..., 3].max() < 0.03, "the shell is not opaque"
    _, directions = camera.rays(camera.pixel_centers())
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert_allclose(seen[..., :3].reshape(-1, 3), sky(directions), atol=0.06)


def test_a_horizon_of_the_background_is_at_most_two_degrees_wide():
    scene = SimpleNamespace(
        field=SimpleNamespace(bounds=torch.zeros(2, 3)),
        background_color=lambda directions: (directions[:, 1:2] > 0).float().expand(-1, 3),
    )
    shell = start._shell(scene, np.zeros((1, 3)), np.eye(3), 1)
    camera = Camera(100, 400, 550.0, 550.0, 50.0, 200.0, np.eye(4))
    rows = rasterize(Gaussians(shell, len(shell), (0, 0, 0), 0.01), camera).image[..., 0].mean(1)
    assert rows[:150].min() > 0.97 and rows[250:].max() < 0.01
    between = np.degrees(np.count_nonzero((rows > 0.1) & (rows < 0.9)) / camera.fy)
    assert between < 2


def test_disks_face_along_their_normals():
    normals = np.float32([(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, -1, 0), (0.6, 0, -0.8), (1e-4, 0, -1)])
    table = np.zeros((len(normals), COLOR), np.float32)
    table[:, ROTATION : ROTATION + 4] = start._rotations_to(normals)
    assert_allclose(axes_of(table)[:, :, 2], normals, atol=0.02)


def test_surface_is_sampled_from_evenly_spread_views():
    for count, found in ((1, 1), (3, 3), (64, 64), (65, 64), (1000, 64)):
        chosen = start.surface_views(range(count))
        assert len(set(chosen)) == len(chosen) == found and (chosen[0], chosen[-1]) == (0, count - 1)


def test_sampling_the_surface_can_be_cancelled_after_each_view(model):
    check = Mock(side_effect=[None, None, Cancelled("The test wants it.")])
    with pytest.raises(Cancelled):
        start.initial_gaussians(model.scene, model.capture.split("train"), 1000, 0, check)
    assert check.call_count == 3


def ring(count):
    """Cameras around MIDDLE at two heights."""
    poses = [camera_at(2 * np.pi * n / count, (0.38, 0.67)[n % 2], distance=4.0).camera_to_world for n in range(count)]
    for pose in poses:
        pose[:3, 3] += MIDDLE
    return [Camera(80, 60, 90.0, 90.0, 40.0, 30.0, pose) for pose in poses]


def scene(kind="opaque"):
    """A scene of uniform gray."""

    def render(camera, n_quantiles):
        return SimpleNamespace(color=torch.full((camera.height, camera.width, 3), 0.25))

    return SimpleNamespace(background_kind=kind, render=Mock(side_effect=render))


def test_pseudo_cameras_need_wide_baselines_and_opaque_photos():
    counts = {("opaque", 10): 10 * start.PSEUDO_VIEWS_PER_PHOTO, ("opaque", 60): 0, ("opaque", 2): 0, ("alpha", 10): 0}
    assert {(kind, n): len(start.pseudo_cameras(scene(kind), ring(n), 0)) for kind, n in counts} == counts


@pytest.mark.parametrize(
    ("photos", "atol"), [(ring(10), 1e-6), (ring(10)[:6], 1e-5)], ids=["all around", "from one side"]
)
def test_pseudo_cameras_keep_the_photos_height_and_distance(photos, atol):
    between = start.pseudo_cameras(scene(), photos, 0)
    beside = np.stack([camera.position - MIDDLE for camera in between])[:, :2]
    angles = np.sort(np.arctan2(*beside.T))
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    assert np.degrees(gaps.max()) < 360 / start.PSEUDO_VIEWS_PER_PHOTO + 1
    for number, camera in enumerate(between):
        own, towards = photos[number // start.PSEUDO_VIEWS_PER_PHOTO], MIDDLE - camera.position
        assert_allclose(np.linalg.norm(towards), 4, atol=atol)
        assert_allclose(-camera.camera_to_world[:3, 2], towards / 4, atol=atol)
        assert_allclose(camera.position[2], own.position[2], atol=atol)
        assert_allclose(camera.camera_to_world[2, :3], own.camera_to_world[2, :3], atol=atol)
        assert (camera.width, camera.fx) == (own.width, own.fx)


def test_seed_determines_pseudo_cameras():
    first, again, other = (
        np.stack([each.position for each in start.pseudo_cameras(scene(), ring(10), seed)]) for seed in (0, 0, 1)
    )
    assert_allclose(first, again)
    assert np.abs(first - other).max() > 0.1


def test_pseudo_photos_are_small_renderings_of_the_field():
    field, check = scene(), Mock()
    large = replace(ring(3)[0], width=2 * start.SIDE, height=start.SIDE, fx=600.0, fy=600.0, cx=256.0, cy=128.0)
    small, halved = start.render_pseudo_photos(field, [ring(3)[1], large], check)
    assert small.color.shape == (60, 80, 3) and halved.color.shape == (start.SIDE // 2, start.SIDE, 3)
    assert (small.color == 64).all() and small.alpha is None and small.valid is None
    assert field.render.call_args.args[0].fx == 300 and halved.camera.width == start.SIDE and check.call_count == 2
