"""Training the heads where memory is short: the batch is taken in parts, and all of it."""

import pytest

torch = pytest.importorskip("torch")

from karf_engine.compute.progress import Progress
from karf_engine.compute.runtime import start_runtime
from karf_engine.heads.fields import SegmentationField
from karf_engine.heads.fit import fit_on_points
from karf_engine.project.settings import SegmentationSettings


class Places:
    """A field whose features are the positions."""

    @staticmethod
    def features(positions):
        return positions


def test_a_batch_too_large_for_the_memory_is_seen_whole_in_parts(monkeypatch):
    most, seen, events = 13, [], []
    logits = SegmentationField.logits

    def remember(karf, positions, features):
        if len(positions) > most:
            raise torch.OutOfMemoryError("no memory left")
        seen.append(len(positions))
        return logits(karf, positions, features)

    monkeypatch.setattr(SegmentationField, "logits", remember)
    runtime = start_runtime(0, 1, "cpu")
    positions = torch.rand(200, 3, generator=runtime.generator) * 2 - 1
    settings = SegmentationSettings(iterations=10, batch=64, width=8)
    karf = SegmentationField(torch.tensor([[[-1.0] * 3, [1.0] * 3]]), 3, settings)
    progress = Progress(lambda kind, **values: events.append(values), lambda: False, "segmentation", 10)
    classes, near = (positions[:, 0] > 0).long(), positions[:, 0].abs() < 0.2
    fit_on_points(karf, Places, positions, classes, torch.ones(200), near, near, settings, runtime, progress)
    assert sum(seen) >= 10 * 0.9 * settings.batch
    assert events[-1]["step"] == 10
