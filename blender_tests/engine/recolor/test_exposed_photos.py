"""Edges of a photo are sought beside a rendering that is exposed as the photo is."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.fields.scene import Picture
from karf_engine.io.images import write_png
from karf_engine.recolor.frames import Frame
from karf_engine.recolor.full_resolution import full_resolution_view
from karf_engine.recolor.matting.marks import Marks


def test_what_the_field_shows_is_exposed_as_the_photo(tmp_path):
    write_png(tmp_path / "v.png", np.full((8, 8, 3), 0.5))
    camera = Camera(8, 8, 8.0, 8.0, 4.0, 4.0, np.eye(4))
    view = View("v", "v", camera, tmp_path / "v.png", "train", gains=(1.2, 1.0, 0.8))
    color, seen = torch.full((8, 8, 3), 0.5), []
    picture = Picture(color, torch.ones(8, 8), torch.ones(8, 8), None)
    frame = Frame(picture, np.zeros((0, 8, 8), np.float32), None, color.numpy())

    def mattes_of(photo, probabilities, rendered, marks):
        seen.append(rendered[0, 0].tolist())
        return []

    full_resolution_view(view, "photo", frame, Marks(None, ()), mattes_of, [], [])
    assert seen == [[153, 128, 102]]
