"""An object whose swatches are tried."""

import numpy as np
import pytest


@pytest.fixture
def pot(addon, learned):
    """An object of a lit and a shaded red and of a green, as photos show them."""
    palette = np.array([[0, 0, 0], [0.8, 0.1, 0.1], [0.4, 0.05, 0.05], [0.1, 0.6, 0.1]], np.float32)
    addon.palettes.load_palettes(learned, [addon.engine_api.Palette("pot", palette)])
    weights = np.repeat(np.eye(4)[1:], 20, axis=0)
    seen = addon.engine_api.ColorHistogram(weights @ palette, np.ones(60), weights)
    addon.displayed.of(learned).learned_histogram = lambda name: seen
    return learned.karf.objects["pot"]
