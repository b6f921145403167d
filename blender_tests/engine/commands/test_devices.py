"""Every stage on a device other than the CPU: that of `--device`, else a pretended one."""

from dataclasses import replace

import numpy as np
import pytest
import torch

pytestmark = pytest.mark.on_device("all stages, interrupted and resumed")
PRETEND = "blender_tests.engine.pretend_device"
pytest.importorskip(PRETEND, reason="this torch has no device made of Python alone", exc_type=ImportError)

from blender_tests.engine.commands.conftest import geometry_command, run
from blender_tests.engine.fields.fitting import points_on_the_still_life
from blender_tests.engine.pretend_device import pretend_device
from blender_tests.engine.reference.nerf import still_life as views_and_photos
from blender_tests.engine.reference.still_life import camera_at
from karf_engine.compute import runtime
from karf_engine.compute.progress import Progress
from karf_engine.fields.files import load_scene, save_scene
from karf_engine.fields.fit import FitInputs
from karf_engine.fields.nerf import importing
from karf_engine.fields.registry import field_kind
from karf_engine.fields.rendering.rays import PixelDataset
from karf_engine.fields.rendering.surface_cache import cache_surface
from karf_engine.fields.scene import psnr_of_views
from karf_engine.project import STAGE_ORDER
from karf_engine.project.settings import GeometrySettings, Level, NerfSettings, OpenSettings

VOXELS = {"levels": (Level(12, 8, 1.0), Level(16, 8, 1.0)), "samples": 4000, "max_rays": 256, "prune_visibility": 0.0}
OPEN = replace(OpenSettings(), radius=0.4, **VOXELS)
NERF = NerfSettings(
    depth=3, width=16, coarse_samples=8, fine_samples=8, iterations=6, rays=32, look_every=3, crop_iterations=2
)
SETTINGS = replace(GeometrySettings(), features=4, prune_alpha=0.0, open=OPEN, nerf=NERF, **VOXELS)
SILENT = Progress(lambda *_, **__: None, lambda: False, "geometry", 1)


@pytest.fixture(params=["float64", "no float64"])
def other_device(request):
    """A device that is not the CPU: that of `--device`, else the pretended one, with float64 or without."""
    if request.config.getoption("device") != "cpu":
        if request.param == "no float64":
            pytest.skip("the device is what it is")
        yield request.getfixturevalue("device")
        return
    with pretend_device(has_float64=request.param == "float64") as device:
        yield device


def start_fit(kind, space, field, device):
    """Start a fit of the still life; returns it with its pixels."""
    views, photos = views_and_photos(sky=kind == "opaque")
    if space == "frustum":
        views = [replace(view, depth_bounds=(2.2, 9.0)) for view in views]
    colors = [photo.color for photo in photos]
    alphas = [photo.alpha for photo in photos] if kind == "alpha" else None
    solids = [photo.color.max(2) > 0.1 for photo in photos] if kind in ("black", "white") else None
    cameras = [view.camera for view in views]
    dataset = PixelDataset(cameras, colors, alphas, solids, device=device)
    points = points_on_the_still_life(cameras, photos)
    where = runtime.start_runtime(0, threads=1, device=str(device))
    inputs = FitInputs(dataset, kind, space, views, points, replace(SETTINGS, field=field), where)
    return field_kind(field).start(inputs), dataset


GEOMETRIES = [
    *(
        "alpha box voxels",
        "black box voxels",
        "opaque box voxels",
        "opaque contraction voxels",
        "opaque frustum voxels",
    ),
    *("alpha box nerf", "opaque contraction nerf", "opaque frustum nerf"),
]


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_geometry_is_learned_stored_and_rendered_on_the_device(geometry, other_device, tmp_path):
    fit, dataset = start_fit(*geometry.split(), other_device)
    *_, scene = fit.scenes(SILENT)
    save_scene(scene, tmp_path / "scene.safetensors")
    camera = camera_at(0.3, 0.5, 12)
    views = [load_scene(tmp_path / "scene.safetensors", device).render(camera, 3) for device in (other_device, "cpu")]
    assert views[0].color.device.type == other_device.type
    assert torch.allclose(views[0].color.cpu(), views[1].color, atol=1e-3)
    assert all(np.isfinite(psnr_of_views(scene, dataset, 20)))
    cache = cache_surface(scene.field, dataset.rays(torch.arange(50, device=other_device)), 3, 1.0)
    field, positions = scene.field, cache.positions.view(-1, 3)
    for values in (field.normals(positions), field.features(positions), field.space.to_world(positions)):
        assert values.device.type == other_device.type and len(values) == len(positions)


def test_foreign_nerf_is_imported_on_the_device(other_device, monkeypatch):
    monkeypatch.setattr(importing, "MIN_PSNR", 0.0)
    fit, dataset = start_fit("opaque", "frustum", "nerf", other_device)
    views = [replace(view, depth_bounds=(2.2, 9.0)) for view in views_and_photos(sky=True)[0]]
    networks = (fit.field.coarse.cpu(), fit.field.fine.cpu())
    scene, _, _ = importing.import_nerf(networks, views, {"opaque": dataset}, SETTINGS.nerf, "a file", other_device)
    assert scene.field.bounds.device.type == other_device.type


QUICK = ("segmentation.iterations=25", "recoloring.iterations=4", "segmentation.rounds=1")
VARIANTS = {
    "default": (),
    "paper": ("segmentation.labels=masks", "palette.shared=true", "recoloring.supervision=reference"),
    "other layers": ("segmentation.layer=bspline", "recoloring.head=mlp", "recoloring.targets=loco"),
}


@pytest.mark.parametrize("settings", VARIANTS.values(), ids=VARIANTS)
def test_later_stages_run_on_the_device(still_life, copy, other_device, tmp_path, settings):
    project = copy.folder
    assert run(*still_life.command(project, *QUICK, *settings), "--device", other_device) == 0
    assert all(copy.finished(stage) for stage in STAGE_ORDER)
    green = tmp_path / "green.json"
    assert run("match", project, "--object", "ball", "--from", "#c0221a", "--to", "#1ec040", "--out", green) == 0
    for base in ("photo", "render"):
        options = ("--edit", green, "--base", base, "--depth", "--planes", "--out", tmp_path / base)
        assert run("render", project, "--views", "test_r_1", *options, "--threads", 1, "--device", other_device) == 0
        assert (tmp_path / base / "recolor" / "test_r_1.png").exists()


def test_geometry_stage_runs_on_the_device(still_life, other_device, tmp_path):
    few = 'geometry.levels=[{"voxels": 12, "iterations": 20, "step": 1.0}]'
    assert run(*geometry_command(still_life, tmp_path / "project", few), "--device", other_device) == 0
    assert (tmp_path / "project" / "preview.png").exists()
