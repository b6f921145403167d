"""Pickling and printing of a loaded model."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from karf_engine.recolor.frames import LONGEST_REPR
from karf_engine.recolor.model import Model


@pytest.fixture(scope="module")
def model(learned):
    return Model.load(learned.project, "cpu")


def test_pickling_a_model_fails_with_advice(model):
    with pytest.raises(TypeError, match=r"model\.project\.folder.*Model\.load"):
        pickle.dumps(model)
    again = Model.load(pickle.loads(pickle.dumps(model.project.folder)), "cpu")
    assert again.objects == model.objects


def test_reprs_are_one_line(model):
    view, many = model.capture.views[0], [f"object\n{number}" for number in range(255)]
    large, photo_view = Model.load(model.project.folder, "cpu"), model.photo_view(view)
    frame = model.render(view.camera.reduced(8))
    large.objects = many
    planes = np.zeros((255, *frame.base.shape[:2]), np.float32)
    large_frame = replace(frame, probabilities=planes, palette_weights=None)
    for value in (model, large, frame, large_frame, photo_view, replace(photo_view, objects=many)):
        text = repr(value)
        assert text.startswith(f"{type(value).__name__}(") and text.endswith(")")
        assert len(text) <= LONGEST_REPR and "\n" not in text
