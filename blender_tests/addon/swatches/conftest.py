"""Objects whose swatches are tried."""

import numpy as np
import pytest

from .scenes import palettes, set_histogram, show_block, show_halves


@pytest.fixture
def pot(addon, learned):
    """An object of a lit and a shaded red and of a green, as photos show them."""
    (palette,) = palettes(addon, pot=[(0.8, 0.1, 0.1), (0.4, 0.05, 0.05), (0.1, 0.6, 0.1)])
    set_histogram(addon, learned, palette.colors, np.repeat(np.eye(4)[1:], 20, axis=0))
    addon.palettes.load_palettes(learned, [palette])
    return learned.karf.objects["pot"]


@pytest.fixture
def pots(addon, learned):
    """The scene with a pot, red on the left and yellow on the right."""
    show_halves(addon, learned)
    return learned


@pytest.fixture
def block(addon, learned):
    """The scene with a red pot in the middle of a gray ground."""
    show_block(addon, learned)
    return learned
