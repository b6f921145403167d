"""Frames of new cameras as files: depth of colors, light, and alpha."""

import numpy as np
import pytest

pytest.importorskip("cv2")
OpenEXR = pytest.importorskip("OpenEXR")

from karf_engine.export.frame_files import write_frame
from karf_engine.export.frame_options import FORMATS
from karf_engine.io.color import srgb_to_linear
from karf_engine.io.images import read_photo

COLOR = np.random.default_rng(0).uniform(0, 1, (6, 5, 3)).astype(np.float32)
ALPHA = np.linspace(0.25, 1, 30, dtype=np.float32).reshape(6, 5, 1)
CLEAR = np.concatenate([COLOR, ALPHA], -1)
STEP = {"png8": 1 / 255, "png16": 1 / 65535, "exr16": 2e-3, "exr32": 1e-6}


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("color", [COLOR, CLEAR], ids=["opaque", "alpha"])
def test_a_frame_reads_back_as_deep_as_it_was_written(tmp_path, kind, color):
    path = tmp_path / f"frame{FORMATS[kind]}"
    write_frame(path, color, kind)
    # what alpha was multiplied into comes back less exactly
    np.testing.assert_allclose(read_photo(path), color, atol=STEP[kind] * (4 if "exr" in kind else 1))


def test_exr_holds_light_with_alpha_multiplied_in(tmp_path):
    write_frame(tmp_path / "a.exr", CLEAR, "exr32")
    channels = OpenEXR.File(str(tmp_path / "a.exr")).channels()
    np.testing.assert_allclose(channels["RGBA"].pixels[..., :3], srgb_to_linear(COLOR) * ALPHA, atol=1e-6)
