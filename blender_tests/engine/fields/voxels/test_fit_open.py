"""Open scenes, with and without sparse points, are learned in a contraction or a frustum."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from blender_tests.engine.fields.fitting import pixel_dataset, points_on_the_still_life, silent, views_of
from blender_tests.engine.reference.still_life import BALL_CENTER, BALL_RADIUS, camera_at, cameras, take_photo
from karf_engine.compute.runtime import start_runtime
from karf_engine.errors import BadRequest
from karf_engine.fields.extent import choose_space, is_forward_facing, min_depth
from karf_engine.fields.files import load_scene, save_scene
from karf_engine.fields.fit import FitInputs
from karf_engine.fields.registry import field_kind
from karf_engine.fields.rendering.space import Box, Contraction
from karf_engine.fields.voxels import fit as voxel_fit
from karf_engine.fields.voxels.field import VoxelField
from karf_engine.fields.voxels.fit_open import find_observations
from karf_engine.fields.voxels.torch_renderer import TorchRenderer, new_renderer
from karf_engine.metrics.images import psnr
from karf_engine.project.settings import GeometrySettings, Level, OpenSettings


def open_settings(*levels, samples=3000, max_rays=512):
    changed = replace(OpenSettings(), levels=levels, samples=samples, max_rays=max_rays)
    return replace(GeometrySettings(), features=6, open=changed)


SETTINGS = open_settings(Level(24, 60, 1.0), Level(48, 110, 1.0), samples=16_000, max_rays=1500)
RING = cameras(20)
FRONT = [camera_at(0.12 * (n % 5 - 2), 0.35 + 0.1 * (n // 5)) for n in range(15)]  # forward-facing


def telephoto(azimuth, elevation, distance=7.0):
    """A distant camera with a long lens; the still life is wider than its picture."""
    camera = camera_at(azimuth, elevation, distance=distance)
    return replace(camera, fx=4 * camera.fx, fy=4 * camera.fy)


TELEPHOTOS = [telephoto(2 * np.pi * n / 20, (0.35, 0.6, 0.85)[n % 3], (6.5, 7.5)[n % 2]) for n in range(20)]


def start(cameras, space, with_points=True, settings=SETTINGS, device="cpu"):
    photos = [take_photo(camera, sky=True) for camera in cameras]
    points = points_on_the_still_life(cameras, photos) if with_points else None
    views = views_of(cameras)
    if space == "frustum":
        views = [replace(view, depth_bounds=(2.2, 9.0)) for view in views]
    dataset, runtime = pixel_dataset(photos, "opaque", device), start_runtime(0, threads=1, device=str(device))
    return field_kind(settings.field).start(FitInputs(dataset, "opaque", space, views, points, settings, runtime))


def fit(*arguments, **options):
    return list(start(*arguments, **options).scenes(silent()))[-1]


def ball_depth_error(scene, angles):
    """Median depth error in the middle of the ball, world units; a pixel that shows some sky would rule the mean."""
    errors = []
    for angle in angles:
        camera = camera_at(angle, 0.5)
        pixel, depth = camera.project(BALL_CENTER[None])
        u, v = np.floor(pixel[0]).astype(int)
        rendered = scene.render(camera, 1).depth.cpu().numpy()[v - 1 : v + 2, u - 1 : u + 2]
        errors.append(np.abs(rendered - (depth[0] - BALL_RADIUS)))
    return float(np.median(errors))


@pytest.mark.on_device("voxels in open space")
@pytest.mark.parametrize(
    ("space", "rig", "angles"), [("contraction", RING, (0.05, 1, 2, 3, 4)), ("frustum", FRONT, (-0.1, 0.05, 0.2))]
)
def test_held_out_view_is_rendered_well(space, rig, angles, tmp_path, device):
    scene, camera = fit(rig, space, device=device), camera_at(0.05, 0.5)
    truth, picture = take_photo(camera, sky=True), scene.render(camera, 3)
    is_object = truth.labels > 0
    assert psnr(picture.color.cpu().numpy()[is_object], truth.color[is_object]) >= 18
    assert picture.opacity.cpu().numpy()[is_object].mean() > 0.95
    assert ball_depth_error(scene, angles) < 0.24  # two voxels
    save_scene(scene, tmp_path / "scene.safetensors")
    loaded = load_scene(tmp_path / "scene.safetensors", device).render(camera, 3)
    assert torch.equal(loaded.color, picture.color) and torch.equal(loaded.depth, picture.depth)


def test_long_lens_views_are_rendered_well():
    scene = fit(TELEPHOTOS, "contraction")
    for angle in (0.15, 1.2, 3.3):
        camera = telephoto(angle, 0.55)
        assert psnr(scene.render(camera, 1).color.numpy(), take_photo(camera, sky=True).color) >= 24


@pytest.mark.parametrize("is_refined", [False, True])
def test_cells_in_free_space_are_left_out(is_refined):
    state = start(TELEPHOTOS, "contraction")
    field = state._refined(Level(40, 1, 1.0)) if is_refined else state.field
    centers = field.space.to_world(field.cell_centers()).double().numpy()
    for camera in TELEPHOTOS:
        pixels, depth = camera.project(centers)
        in_view = ((pixels > 0) & (pixels < camera.width)).all(1) & (depth > 0)
        nearest = np.linalg.norm(camera.position) - 1.1
        assert not (in_view & (depth < 0.85 * nearest)).any()


def test_sparse_points_improve_the_surface_depth():
    few = [camera_at(angle, 0.5) for angle in (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75)]
    scenes = (fit(few, "contraction", with_points) for with_points in (True, False))
    with_points, without = (ball_depth_error(scene, (-0.37, -0.12, 0.12, 0.37)) for scene in scenes)
    assert with_points < 0.12
    assert with_points < 0.8 * without


def test_total_variation_uses_no_pruned_vertex(monkeypatch):
    all_rows, differences, prune = [], TorchRenderer.differences, VoxelField.pruned

    def record(renderer, rows, other_rows):
        all_rows.append(rows)
        return differences(renderer, rows, other_rows)

    state = start(cameras(8), "contraction", True, open_settings(Level(12, 16, 1.0), Level(16, 4, 1.0)))
    monkeypatch.setenv("KARF_KERNELS", "off")
    monkeypatch.setattr(TorchRenderer, "differences", record)
    monkeypatch.setattr(
        VoxelField, "pruned", lambda field, keep: prune(field, keep & (torch.arange(len(keep)) < len(keep) // 2))
    )
    list(state.scenes(silent()))
    # a vertex without a row of its own would be taken for the first row, which is one of hundreds
    assert max((rows == 0).float().mean().item() for rows in all_rows) < 0.02


def test_pruning_keeps_cells_that_photos_show(monkeypatch):
    monkeypatch.setattr(voxel_fit, "BATCH_RAYS", 64)
    monkeypatch.setattr(voxel_fit, "FEWEST_BATCHES", 2)  # which alone miss 5 % of the visible cells
    few = open_settings(Level(40, 30, 1.0), Level(48, 1, 1.0), samples=6000, max_rays=1500)
    state = start(cameras(8), "contraction", True, few)
    unpruned = next(state.scenes(silent())).field
    renderer = new_renderer(unpruned, state.runtime, 1.0, 0.0, 0.1, 0.1)
    parts = torch.arange(len(state.dataset)).split(4096)
    is_shown = renderer.visibility(state.dataset.rays(part) for part in parts) > 0.1
    kept = state._pruned().occupied[unpruned.occupied]
    assert kept[is_shown].float().mean() > 0.99
    assert kept.float().mean() < 0.97


def test_pruning_of_fog_does_not_depend_on_cell_size(monkeypatch):
    monkeypatch.setattr(voxel_fit, "PRUNED_AT", 12)
    state = start(cameras(8), "contraction", True, open_settings(Level(12, 5, 1.0)))
    learned = next(state.scenes(silent())).field

    def kept_share(n):
        voxel = 12 * learned.voxel / n
        field = VoxelField(learned.minimum, voxel, torch.ones(n, n, n, dtype=torch.bool), 6, space=learned.space)
        optical_depth = torch.tensor(0.03 * 12 / n)  # of a cell
        field.raw_density.data.fill_(optical_depth.expm1().log() - field.density_bias)
        state.field, state.renderer = field, state._new_renderer(field)
        return state._pruned().occupied.float().mean().item()

    assert kept_share(24) > 0.7 * kept_share(12) > 0.4


PHOTOS = [take_photo(camera) for camera in RING]
ON_TABLE, ALL_ROUND = (points_on_the_still_life(RING, PHOTOS, spread) for spread in (1.0, 8.0))


@pytest.mark.parametrize(
    ("kind", "cameras", "bounds", "points", "setting", "space"),
    [
        ("alpha", RING, None, ALL_ROUND, "auto", "box"),
        ("opaque", RING, None, ON_TABLE, "auto", "box"),
        ("opaque", RING, None, ALL_ROUND, "auto", "contraction"),
        ("opaque", RING, None, None, "auto", "box"),
        ("opaque", FRONT, (2.0, 9.0), None, "auto", "frustum"),
        ("opaque", FRONT, None, ON_TABLE, "auto", "frustum"),
        ("opaque", RING, None, ON_TABLE, "contraction", "contraction"),
    ],
)
def test_space_follows_from_background_cameras_and_points(kind, cameras, bounds, points, setting, space):
    views = [replace(view, depth_bounds=bounds) for view in views_of(cameras)]
    assert choose_space(kind, views, points, replace(GeometrySettings(), space=setting)) == space
    assert is_forward_facing(cameras) == (cameras is FRONT)


def test_nearest_depth_is_declared_or_taken_from_points():
    assert min_depth(views_of(RING), ON_TABLE) == pytest.approx(3.6 - 0.8, abs=0.25)
    declared = [replace(view, depth_bounds=(1.5 + n, 99.0)) for n, view in enumerate(views_of(RING))]
    assert min_depth(declared, ON_TABLE) == 1.5
    assert min_depth(views_of(RING), None) is None


def test_frustum_without_any_depth_is_rejected():
    dataset = pixel_dataset([take_photo(camera) for camera in FRONT], "opaque")
    inputs = FitInputs(dataset, "opaque", "frustum", views_of(FRONT), None, SETTINGS, start_runtime(0, 1, "cpu"))
    with pytest.raises(BadRequest, match="how near"):
        field_kind("voxels").start(inputs)


def test_observations_pair_points_with_the_pixels_that_show_them():
    dataset = pixel_dataset(PHOTOS, "opaque")
    pixels, positions = find_observations(dataset, Box(), ON_TABLE)
    assert len(pixels) == len(positions) == len(ON_TABLE.view)
    rays = dataset.rays(pixels)
    toward = torch.nn.functional.normalize(positions - rays.origins, dim=1)
    assert (toward * rays.viewdirs).sum(1).min() > np.cos(1.0 / RING[0].fx)  # within a pixel
    inexact = replace(ON_TABLE, errors=np.where(np.arange(300) < 150, 9.0, 0.3).astype(np.float32))
    assert len(find_observations(dataset, Box(), inexact)[0]) == (ON_TABLE.point >= 150).sum()


def test_contraction_covers_what_cameras_see():
    space = Contraction(torch.zeros(3), 1.0, 1.0, 0.1)
    pair = [camera_at(0.0, 0.3), camera_at(0.4, 0.3)]
    behind_both = pair[0].position + pair[1].position
    at_border = pair[0].position + pair[0].camera_to_world[:3, :3] @ [0.48 * 32 / pair[0].fx, 0.0, -1.0]
    world = torch.tensor(np.stack([np.zeros(3), behind_both, [0.0, 0, 30], at_border])).float()
    assert space.is_seen(space.to_grid(world), pair).tolist() == [True, False, False, True]
    low, high = space.grid_bounds(pair)
    assert low.tolist() == [-2, -2, -2] and high.tolist() == [2, 2, 2]
