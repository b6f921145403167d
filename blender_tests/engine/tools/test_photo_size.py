"""The photos of the bench have the size and format that they are named by; recoloring one keeps what is outside."""

from __future__ import annotations

from dataclasses import replace

import pytest

import karf_engine as karf
from karf_engine.recolor.photos import open_photo, suffix_for, write_photo
from tools.speed.photo_size import WRITERS, covered_by, enlarged, other_colors, outside_is_equal, photo_view

TYPES = {".png": "uint8", ".16-bit.png": "uint16", ".jpg": "uint8", ".16-bit.tif": "uint16", ".exr": "float16"}


@pytest.mark.parametrize("name", WRITERS)
def test_a_recolored_photo_keeps_all_that_no_object_covers(learned, tmp_path, name):
    model = karf.load(learned.project)
    path = tmp_path / f"photo{name}"
    WRITERS[name](path, enlarged(model, 0.01))
    photo = open_photo(path)
    assert photo.pixels.dtype == TYPES[name] and photo.size[0] * photo.size[1] == pytest.approx(10_000, rel=0.05)
    view = model.capture.split("test")[0]
    view = replace(view, image=path, camera=view.camera.scaled(*photo.size))
    ready = photo_view(model, view, 1)
    recolored = ready.recolor(other_colors(ready.palettes))
    out = tmp_path / f"out{suffix_for(recolored)}"
    write_photo(out, recolored)
    assert len(ready.mattes) == 1 and outside_is_equal(ready, out)
    recolored.pixels[~covered_by(ready)] += 1
    write_photo(out, recolored)
    assert not outside_is_equal(ready, out)
