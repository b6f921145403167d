"""Masks of a captured view, asked of the engine as Blender asks it."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from karf_engine.errors import KarfError
from karf_engine.io.images import read_pixels
from karf_engine.recolor.model import Model
from karf_engine.worker.queries.photos import masks
from karf_engine.worker.queries.session import Session


def test_masks_are_how_far_the_segmented_objects_cover_the_view(tmp_path, learned):
    model = Model.load(learned.project)
    view = model.capture.views[-1]
    answer = masks(Session(tmp_path, threads=1, device="cpu"), {"project": str(learned.project), "view": view.name})
    expected = dict(zip(model.objects, model.render_field(model.working_camera(view)).probabilities, strict=True))
    assert answer["masks"].keys() == expected.keys()
    for name, file in answer["masks"].items():
        pixels, _ = read_pixels(Path(file), False)
        assert np.abs(pixels.reshape(*pixels.shape[:2], -1)[..., 0] / 255 - expected[name]).max() < 1 / 255


@pytest.mark.parametrize("options", [{"view": "nowhere"}, {"view": 3}])
def test_a_view_that_is_not_there_is_refused(tmp_path, learned, options):
    with pytest.raises(KarfError, match="view"):
        masks(Session(tmp_path), {"project": str(learned.project)} | options)
