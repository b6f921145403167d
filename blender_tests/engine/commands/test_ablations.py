"""The settings of the paper's ablations change what they name and nothing else."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from karf_engine.commands.job import make_job
from karf_engine.commands.recoloring import rays_of, whole_scene
from karf_engine.compute.progress import Progress
from karf_engine.compute.runtime import start_runtime
from karf_engine.fields.files import load_scene
from karf_engine.heads.fields import RecoloringField
from karf_engine.heads.files import SURFACE_SCHEMA, load_segmentation, load_surface
from karf_engine.heads.fit import fit_recoloring
from karf_engine.heads.training_rays import BACKGROUND
from karf_engine.io.checkpoints import load_tensors
from karf_engine.io.options import Options
from karf_engine.palettes.compositing import stack_palettes
from karf_engine.palettes.extraction import extract_palettes
from karf_engine.palettes.palette import read_palettes
from karf_engine.project import Project
from karf_engine.project import settings as settings_module
from karf_engine.project.settings import PaletteSettings, RecoloringSettings
from karf_engine.segmentation.report import SegmentationReport


@pytest.fixture(scope="module")
def scene(learned):
    """Return the still life as learned by the stages before recoloring, and a job that reads it."""
    project = Project(learned.project)
    settings = settings_module.from_dict(project.state()["settings"])
    field = load_scene(project.geometry_file).field
    return SimpleNamespace(
        job=make_job(project, Options(threads=1, device="cpu"), settings, lambda *_, **__: None, lambda: False),
        field=field,
        palettes=read_palettes(project.palette_file, "initial"),
        segmentation=load_segmentation(project.segmentation_file, field.n_features)[0],
        surface=load_surface(project.surface_file)[0],
    )


def stacked_palettes(scene):
    return torch.from_numpy(stack_palettes(["ball", "block"], {p.name: p.colors for p in scene.palettes}))


def fit(scene, rays, settings):
    """Train a recoloring field, always from the same initial values."""
    torch.manual_seed(0)
    counts = [len(palette.colors) for palette in scene.palettes]
    karf = RecoloringField(scene.segmentation.bounds, scene.field.n_features, counts, settings)
    progress = Progress(lambda *_, **__: None, lambda: False, "recoloring", settings.iterations)
    where = start_runtime(0, 1, "cpu")
    fit_recoloring(karf, scene.field, rays, stacked_palettes(scene), settings, where, progress)
    return karf


def rays_with(scene, *overrides):
    """The rays that F_w learns from with changed settings."""
    changed = replace(scene.job, settings=settings_module.with_overrides(scene.job.settings, list(overrides)))
    return rays_of(changed, scene.field, scene.surface, scene.palettes)


def test_random_palette_has_hull_size_black_first_and_follows_seed():
    reddish = [0.3, 0.0, 0.0], [0.9, 0.3, 0.5], (2, 4000, 3)
    pixels = [list(np.random.default_rng(seed).uniform(*reddish).astype(np.float32)) for seed in (0, 1)]
    hull = extract_palettes(["a", "b"], pixels, PaletteSettings())
    first, again, other = (
        extract_palettes(["a", "b"], pixels, PaletteSettings(start="random"), seed) for seed in (3, 3, 4)
    )
    for k in range(2):
        assert first[k].colors.shape == hull[k].colors.shape and first[k].colors.dtype == np.float32
        assert not first[k].colors[0].any() and 0 <= first[k].colors.min() <= first[k].colors.max() <= 1
        assert np.array_equal(first[k].colors, again[k].colors)
        assert not np.array_equal(first[k].colors, other[k].colors)
    assert not np.array_equal(first[0].colors[1:3], first[1].colors[1:3])


def test_reference_supervision_uses_only_rays_of_masked_views(scene):
    everywhere = rays_with(scene)
    assert everywhere.supervised.all()
    masked = rays_with(scene, "recoloring.supervision=reference")
    views = SegmentationReport.read(scene.job.project.segmentation_report).views
    tensors, _ = load_tensors(scene.job.project.surface_file, SURFACE_SCHEMA)
    names = [views[number] for number in tensors["view"][tensors["sure"]].tolist()]
    assert masked.supervised.tolist() == [name in ("r_8", "train_r_0") for name in names]
    assert 0 < masked.supervised.sum() < len(masked.supervised)
    assert torch.equal(masked.weights[masked.supervised], everywhere.weights[masked.supervised])
    assert not masked.weights[~masked.supervised].any()


def test_background_is_learned_as_black(scene):
    surface, opacity = whole_scene(scene.job, scene.field, scene.segmentation)
    rays = rays_of(scene.job, scene.field, surface, scene.palettes, opacity)
    is_behind = surface.object == BACKGROUND
    assert len(rays.colors) == len(surface.colors) and (~is_behind).sum() == len(scene.surface.colors)
    assert (rays.weights[is_behind, 0] == 1).all() and not rays.weights[is_behind, 1:].any()
    assert not rays.colors[is_behind].any() and torch.equal(rays.opacity, opacity)
    karf = fit(scene, rays, RecoloringSettings(iterations=60, batch=512, width=16))
    with torch.no_grad():
        middle = rays.positions[:, rays.positions.shape[1] // 2]
        black = karf(middle, rays.viewdirs, scene.field.features(middle))[..., 0]
    assert black[is_behind & (opacity > 0.9)].median() > 0.9 > 0.5 > black[surface.object < BACKGROUND].median()


def test_unsupervised_weights_do_not_affect_learning(scene):
    rays = rays_with(scene)
    some = torch.arange(len(rays.colors)) % 3 == 0
    settings = RecoloringSettings(iterations=5, batch=128, width=8, weight_loss=1.0)

    def learned_with(weights):
        karf = fit(scene, replace(rays, weights=weights, supervised=some), settings)
        return torch.cat([parameter.detach().ravel() for parameter in karf.parameters()])

    reversed_weights = rays.weights.flip(1)
    plain = learned_with(rays.weights)
    assert torch.equal(plain, learned_with(torch.where(some[:, None], rays.weights, reversed_weights)))
    assert not torch.equal(plain, learned_with(torch.where(some[:, None], reversed_weights, rays.weights)))


@pytest.mark.parametrize(("schedule", "highest", "lowest"), [("constant", 1.0, 1.0), ("cosine", 0.7, 0.02)])
def test_learning_rate_is_constant_or_warms_up_and_falls(scene, monkeypatch, schedule, highest, lowest):
    factors = []

    def record_factors(training_state, until, step, factor, progress, checkpoint):
        factors.extend(factor(i, training_state.iterations) for i in range(until + 1))

    monkeypatch.setattr("karf_engine.heads.fit.train", record_factors)
    fit(scene, rays_with(scene), RecoloringSettings(iterations=60, schedule=schedule))
    assert max(factors) == pytest.approx(highest, abs=0.1) and min(factors[20:]) == pytest.approx(lowest)
    assert (factors[0] < 0.1) == (schedule == "cosine")


def test_loco_targets_reproduce_colors_but_depend_on_position(scene):
    star, loco = rays_with(scene), rays_with(scene, "recoloring.targets=loco")
    mixed = torch.einsum("nm,nmc->nc", loco.weights, stacked_palettes(scene)[loco.block])
    assert float((mixed - loco.colors).square().sum(1).mean().sqrt()) < 5 / 255
    assert float(loco.weights.min()) >= 0 and torch.allclose(loco.weights.sum(1), torch.ones(len(mixed)), atol=1e-5)
    assert torch.equal(loco.colors, star.colors)
    assert float((loco.weights - star.weights).abs().max()) > 1e-3
