"""Heads are evaluated once per distinct sample of a ray; their training fits into memory and has data."""

import numpy as np
import pytest
import torch

from blender_tests.engine.fields.fitting import learn_head, silent
from karf_engine.compute.progress import Progress
from karf_engine.compute.runtime import start_runtime
from karf_engine.errors import DataError
from karf_engine.fields.rendering.surface_cache import SurfaceCache
from karf_engine.heads.fields import RecoloringField, SegmentationField
from karf_engine.heads.fit import ObjectRays, fit_recoloring
from karf_engine.heads.rendering import features_of, object_samples, render_classes, segment_cache, weigh_cache
from karf_engine.heads.training_rays import BACKGROUND, ObjectSurface, training_rays
from karf_engine.palettes.palette import Palette
from karf_engine.project.settings import RecoloringSettings, SegmentationSettings


class Waves:
    """A field of four features that records the number of positions of each call."""

    n_features = 4

    def __init__(self):
        self.calls = []

    def features(self, positions):
        self.calls.append(len(positions))
        return torch.cat([torch.sin(5 * positions), positions[:, :1]], 1)


@pytest.fixture
def cache():
    """40 rays of 8 quantiles, some of them on the same sample; the last 10 rays meet no object."""
    random = torch.Generator().manual_seed(0)
    distances = torch.randint(0, 5, (40, 8), generator=random).float().sort(1).values
    origins, viewdirs = torch.rand(40, 3, generator=random) - 0.5, torch.zeros(40, 3)
    viewdirs[:, 2] = 1.0
    origins[30:] += 9.0
    positions = origins[:, None] + 0.1 * distances[..., None] * viewdirs[:, None]
    return SurfaceCache(positions, distances, viewdirs, torch.rand(40, generator=random), torch.arange(40))


@pytest.fixture
def heads():
    torch.manual_seed(0)
    boxes = torch.tensor([[[-1.0, -1.0, -1.0], [0.1, 1.0, 1.0]], [[-0.1, -1.0, -1.0], [1.0, 1.0, 1.0]]])
    segmentation = SegmentationField(boxes, 4, SegmentationSettings(width=8)).requires_grad_(False)
    recoloring = RecoloringField(segmentation.bounds, 4, [3, 4], RecoloringSettings(width=8)).requires_grad_(False)
    return segmentation, recoloring


def test_classes_need_one_evaluation_per_distinct_sample(cache, heads):
    field, (segmentation, _) = Waves(), heads
    expected = render_classes(segmentation, cache.positions, features_of(Waves(), cache.positions), cache.opacity)
    assert torch.allclose(segment_cache(segmentation, field, cache), expected, atol=1e-6)
    inside = cache.distances[:30]
    assert sum(field.calls) == int((inside[:, 1:] != inside[:, :-1]).sum()) + 30


def test_masks_and_weights_share_one_evaluation(cache, heads):
    field, (segmentation, recoloring) = Waves(), heads
    samples = object_samples(segmentation, field, cache)
    assert torch.equal(samples.rendered, segment_cache(segmentation, Waves(), cache))
    flat, features = cache.positions.view(-1, 3), features_of(Waves(), cache.positions).flatten(0, 1)
    directions = cache.viewdirs.repeat_interleave(8, 0)
    products = segmentation(flat, features)[:, 1:, None] * recoloring(flat, directions, features)
    expected = products.view(40, 8, 2, 4).mean(1) * cache.opacity[:, None, None]
    calls = list(field.calls)
    assert torch.allclose(weigh_cache(recoloring, samples, cache), expected, atol=2 / 1024)
    assert field.calls == calls


@pytest.mark.parametrize(("iterations", "calls"), [(2, [40, 128, 128]), (40, [40, 320])])
def test_training_evaluates_features_once_if_that_is_less_work(cache, heads, iterations, calls):
    """40 rays in batches of 16: two iterations do not draw all of them, forty draw each many times."""
    field, settings = Waves(), RecoloringSettings(iterations=iterations, batch=16, width=8)
    palettes, block = torch.rand(2, 4, 3), torch.arange(40) % 2
    rays = ObjectRays(cache.positions, cache.viewdirs, torch.rand(40, 3), torch.zeros(40).long(), block,
                      torch.rand(40, 4), torch.ones(40, dtype=torch.bool), torch.ones(40))  # fmt: skip
    karf = RecoloringField(heads[0].bounds, 4, [4, 4], settings)
    fit_recoloring(karf, field, rays, palettes, settings, start_runtime(0, 1, "cpu"), silent())
    assert field.calls == calls  # the first call is for the standardizer


def test_batch_too_large_for_memory_is_processed_in_parts(monkeypatch):
    sizes, events, logits = [], [], SegmentationField.logits

    def limited(karf, positions, features):
        if len(positions) > 13:
            raise torch.OutOfMemoryError("no memory left")
        sizes.append(len(positions))
        return logits(karf, positions, features)

    monkeypatch.setattr(SegmentationField, "logits", limited)
    settings = SegmentationSettings(iterations=10, batch=64, width=8)
    progress = Progress(lambda kind, **values: events.append(values), lambda: False, "segmentation", 10)
    learn_head("points", Waves(), settings, start_runtime(0, 1, "cpu"), progress)
    assert sum(sizes) >= 10 * 0.9 * settings.batch
    assert events[-1]["step"] == 10


def rays_of(owners):
    """Training rays of a surface with one red sample for each of these object numbers."""
    n, palette = len(owners), np.array([[0, 0, 0], [1, 0, 0]], np.float32)
    colors = torch.tensor([[255, 0, 0]], dtype=torch.uint8).expand(n, 3)
    owner, view = torch.tensor(owners, dtype=torch.uint8), torch.zeros(n, dtype=torch.int16)
    is_interior = torch.ones(n, dtype=torch.bool)
    surface = ObjectSurface(torch.zeros(n, 1, 3), torch.zeros(n, 3), colors, owner, is_interior, view)
    return training_rays(None, surface, [Palette(name, palette) for name in ("ball", "block")], RecoloringSettings())


def test_training_needs_surface_points_of_an_object_or_the_background():
    for owners in ([1], [BACKGROUND]):
        assert rays_of(owners).weights.sum(1).tolist() == [1]
    with pytest.raises(DataError) as caught:
        rays_of([])
    assert caught.value.sentence == "The segmentation has no surface points of 'ball', 'block'."
    assert "another photo" in caught.value.hint and "mask" in caught.value.hint
