"""Frames of new cameras as files: depth of colors, light, and alpha."""

import numpy as np
import pytest

pytest.importorskip("cv2")
OpenEXR = pytest.importorskip("OpenEXR")

from karf_engine.color import srgb_to_linear
from karf_engine.frame_files import FORMATS, cut_out, write_frame
from karf_engine.images import read_photo

COLOR = np.random.default_rng(0).uniform(0, 1, (6, 5, 3)).astype(np.float32)
ALPHA = np.linspace(0.25, 1, 30, dtype=np.float32).reshape(6, 5)
STEP = {"png8": 1 / 255, "png16": 1 / 65535, "exr16": 2e-3, "exr32": 1e-6}


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("alpha", [None, ALPHA], ids=["opaque", "alpha"])
def test_a_frame_reads_back_as_deep_as_it_was_written(tmp_path, kind, alpha):
    path = write_frame(tmp_path / "frame.0001", COLOR, alpha, kind)
    assert path.name == f"frame.0001{FORMATS[kind]}"
    read = read_photo(path)
    assert read.shape[-1] == (3 if alpha is None else 4)
    np.testing.assert_allclose(read[..., :3], COLOR, atol=STEP[kind] * (1 if alpha is None else 4))
    if alpha is not None:
        np.testing.assert_allclose(read[..., 3], ALPHA, atol=STEP[kind])


def test_exr_holds_light_with_alpha_multiplied_in(tmp_path):
    channels = OpenEXR.File(str(write_frame(tmp_path / "a", COLOR, ALPHA, "exr32"))).channels()
    np.testing.assert_allclose(channels["RGBA"].pixels[..., :3], srgb_to_linear(COLOR) * ALPHA[..., None], atol=1e-6)


def test_what_is_behind_is_taken_out_of_a_mixture():
    behind = np.full_like(COLOR, 1.0)
    mixed = COLOR * ALPHA[..., None] + behind * (1 - ALPHA[..., None])
    np.testing.assert_allclose(cut_out(mixed, ALPHA, behind), COLOR, atol=1e-5)
    assert not cut_out(behind, np.zeros((6, 5), np.float32), behind).any()
