"""What the settings of the paper's ablations change, and that they change nothing else."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from karf_engine import settings as settings_module
from karf_engine.checkpoints import load_tensors
from karf_engine.edit.compositing import stack_palettes
from karf_engine.fields.files import load_scene
from karf_engine.files import read_json
from karf_engine.heads.fields import RecoloringField
from karf_engine.heads.files import SURFACE_SCHEMA, load_segmentation
from karf_engine.heads.fit import fit_recoloring
from karf_engine.progress import Progress
from karf_engine.project import Project
from karf_engine.runtime import start_runtime
from karf_engine.settings import PaletteSettings, RecoloringSettings
from karf_engine.stages import recoloring
from karf_engine.stages.job import make_job
from karf_engine.stages.palette import extract_palettes


@pytest.fixture(scope="module")
def job(learned):
    """The still life's project, opened to read."""
    project = Project(learned.project)
    settings = settings_module.from_dict(project.state()["settings"])
    return make_job(project, {"threads": 1, "device": "cpu"}, settings, lambda *_, **__: None, lambda: False)


def reddish(seed):
    random = np.random.default_rng(seed)
    return [random.uniform([0.3, 0.0, 0.0], [0.9, 0.3, 0.5], (4000, 3)).astype(np.float32) for _ in range(2)]


def test_a_random_palette_is_as_large_as_the_hull_begins_with_black_and_follows_the_seed():
    pixels = [reddish(0), reddish(1)]
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


def test_reference_supervision_asks_only_rays_of_marked_views_for_their_weights(job):
    palettes = recoloring.initial_palettes(job)
    field = load_scene(job.project.geometry_file).field
    everywhere = recoloring.object_rays(job, field, palettes)
    assert everywhere.supervised.all()
    changed = settings_module.with_overrides(job.settings, ["recoloring.supervision=reference"])
    marked = recoloring.object_rays(replace(job, settings=changed), field, palettes)
    views = read_json(job.project.segmentation_report, "report")["views"]
    tensors, _ = load_tensors(job.project.surface_file, SURFACE_SCHEMA)
    names = [views[number] for number in tensors["view"][tensors["sure"]].tolist()]
    assert marked.supervised.tolist() == [name in ("r_8", "train_r_0") for name in names]
    assert 0 < marked.supervised.sum() < len(marked.supervised)
    assert torch.equal(marked.weights[marked.supervised], everywhere.weights[marked.supervised])
    assert not marked.weights[~marked.supervised].any()


def test_weights_of_rays_that_are_not_asked_teach_nothing(job):
    scene = load_scene(job.project.geometry_file)
    bounds = load_segmentation(job.project.segmentation_file, scene.field.n_features)[0].bounds
    palettes = recoloring.initial_palettes(job)
    rays = recoloring.object_rays(job, load_scene(job.project.geometry_file).field, palettes)
    some = torch.arange(len(rays.colors)) % 3 == 0
    sizes = [len(palette.colors) for palette in palettes]
    stacked = torch.from_numpy(stack_palettes(["ball", "block"], {p.name: p.colors for p in palettes}))
    settings = RecoloringSettings(iterations=5, batch=128, width=8, weight_loss=1.0)

    def learned_with(weights):
        torch.manual_seed(0)
        karf = RecoloringField(bounds, scene.field.n_features, sizes, settings)
        progress = Progress(lambda *_, **__: None, lambda: False, "recoloring", settings.iterations)
        given = replace(rays, weights=weights, supervised=some)
        fit_recoloring(karf, scene.field, given, stacked, settings, start_runtime(0, 1, "cpu"), progress)
        return torch.cat([parameter.detach().ravel() for parameter in karf.parameters()])

    reversed_weights = rays.weights.flip(1)
    plain = learned_with(rays.weights)
    assert torch.equal(plain, learned_with(torch.where(some[:, None], rays.weights, reversed_weights)))
    assert not torch.equal(plain, learned_with(torch.where(some[:, None], reversed_weights, rays.weights)))


@pytest.mark.parametrize(("schedule", "highest", "lowest"), [("constant", 1.0, 1.0), ("cosine", 0.7, 0.02)])
def test_the_rate_is_constant_or_warms_up_and_falls(job, monkeypatch, schedule, highest, lowest):
    factors = []

    def note(course, until, step, factor, progress, unfinished):
        factors.extend(factor(i, course.iterations) for i in range(until + 1))

    monkeypatch.setattr("karf_engine.heads.fit.train", note)
    palettes, scene = recoloring.initial_palettes(job), load_scene(job.project.geometry_file)
    rays = recoloring.object_rays(job, scene.field, palettes)
    settings = RecoloringSettings(iterations=60, schedule=schedule)
    karf = RecoloringField(
        load_segmentation(job.project.segmentation_file, scene.field.n_features)[0].bounds,
        scene.field.n_features,
        [4, 4],
        settings,
    )
    fit_recoloring(karf, scene.field, rays, torch.zeros(2, 4, 3), settings, job.runtime, job.progress("test", 1))
    assert max(factors) == pytest.approx(highest, abs=0.1) and min(factors[20:]) == pytest.approx(lowest)
    assert (factors[0] < 0.1) == (schedule == "cosine")


def test_loco_targets_give_the_colors_back_but_depend_on_the_place(job):
    palettes, field = recoloring.initial_palettes(job), load_scene(job.project.geometry_file).field
    star = recoloring.object_rays(job, field, palettes)
    changed = settings_module.with_overrides(job.settings, ["recoloring.targets=loco"])
    loco = recoloring.object_rays(replace(job, settings=changed), field, palettes)
    stacked = torch.from_numpy(stack_palettes([p.name for p in palettes], {p.name: p.colors for p in palettes}))
    mixed = torch.einsum("nm,nmc->nc", loco.weights, stacked[loco.block])
    assert float((mixed - loco.colors).square().sum(1).mean().sqrt()) < 5 / 255
    assert float(loco.weights.min()) >= 0 and torch.allclose(loco.weights.sum(1), torch.ones(len(mixed)), atol=1e-5)
    assert torch.equal(loco.colors, star.colors)
    assert float((loco.weights - star.weights).abs().max()) > 1e-3
