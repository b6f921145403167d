"""Several rays a pixel: colors are averaged, depths never lie between two surfaces."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch")

from karf_engine.fields.scene import Picture
from karf_engine.recolor.frames import Frame, downsample, remove_background


def frame_of(color, depth):
    picture = Picture(torch.tensor(color), torch.tensor((depth > 0).astype(np.float32)), torch.tensor(depth), None)
    return Frame(picture, (depth > 0)[None].astype(np.float32), None, color)


def test_a_pixel_is_the_mean_of_its_rays_and_its_depth_that_of_one_of_them():
    depth = np.array([[2, 2, 0, 0, 0, 0], [2, 9, 0, 7, 0, 0]], np.float32)
    color = np.repeat(depth[..., None] / 10, 3, -1)
    frame = downsample(frame_of(color, depth), 2)
    assert_allclose(frame.color[0, :, 0], [0.375, 0.175, 0])
    assert_allclose(frame.opacity, [[1, 0.25, 0]])
    assert_allclose(frame.probabilities, [[[1, 0.25, 0]]])
    assert_allclose(frame.depth, [[2, 7, 0]])


@pytest.mark.parametrize("background", [0.0, 0.4, 1.0])
def test_what_is_cut_out_gives_the_picture_again_on_its_background(background):
    random = np.random.default_rng(0)
    own, opacity = random.random((4, 5, 3)), random.random((4, 5))
    opacity[0, 0] = 0
    behind = np.full((4, 5, 3), background)
    shown = own * opacity[..., None] + behind * (1 - opacity[..., None])
    cut = remove_background(shown, opacity, behind)
    assert_allclose(cut[..., 3], opacity, atol=1e-6)
    assert_allclose(cut[..., :3] * cut[..., 3:] + behind * (1 - cut[..., 3:]), shown, atol=1e-6)
    assert (cut[0, 0] == 0).all()
