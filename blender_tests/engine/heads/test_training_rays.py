"""Training rays of F_w: what is refused where segmentation found no object."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")

from karf_engine.errors import DataError
from karf_engine.heads.training_rays import BACKGROUND, ObjectSurface, training_rays
from karf_engine.palettes.palette import Palette
from karf_engine.project.settings import RecoloringSettings

BLACK_AND_RED = np.array([[0, 0, 0], [1, 0, 0]], np.float32)
PALETTES = [Palette(name, BLACK_AND_RED) for name in ("ball", "block")]


def surface_of(owners):
    """Interior rays of one sample, red, of these object numbers."""
    n = len(owners)
    colors = torch.tensor([[255, 0, 0]], dtype=torch.uint8).expand(n, 3)
    owner, view = torch.tensor(owners, dtype=torch.uint8), torch.zeros(n, dtype=torch.int16)
    return ObjectSurface(torch.zeros(n, 1, 3), torch.zeros(n, 3), colors, owner, torch.ones(n, dtype=torch.bool), view)


def test_a_segmentation_of_nothing_is_refused_with_the_objects_and_a_remedy():
    with pytest.raises(DataError) as caught:
        training_rays(None, surface_of([]), PALETTES, RecoloringSettings())
    assert caught.value.sentence == "The segmentation has no surface points of 'ball', 'block'."
    assert "another photo" in caught.value.hint and "mask" in caught.value.hint


@pytest.mark.parametrize("owners", [[1], [BACKGROUND]])
def test_one_object_or_the_background_alone_is_enough(owners):
    rays = training_rays(None, surface_of(owners), PALETTES, RecoloringSettings())
    assert len(rays.weights) == 1 and rays.weights.sum() == 1
