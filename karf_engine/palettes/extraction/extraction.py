"""Extract the palettes and color histograms of objects from their pixels in each view."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...project.settings import PaletteSettings
from ..object_colors import ColorHistogram
from ..palette import Palette
from .barycentric_weights import star_weights
from .cells import cell_support, color_cells
from .hull import extract_palette


def extract_palettes(
    names: Sequence[str], pixels: Sequence[Sequence[np.ndarray]], settings: PaletteSettings, seed: int = 0
) -> list[Palette]:
    """Extract one palette per object, or a shared one from all colors if the settings ask for it.

    Args:
        names: Of the objects.
        pixels: Photo colors of each object in each view, [n, 3] sRGB in [0, 1]; at least one color per object.
        settings: Size, tolerance, start and sharing.
        seed: For the random colors of `start="random"`.

    Examples:
        >>> red = np.repeat([[0.2, 0, 0], [0.8, 0, 0]], 50, axis=0)
        >>> for palette in extract_palettes(["pot", "lid"], [[red], [red / 2]], PaletteSettings()):
        ...     print(palette.name, (100 * palette.colors).round().tolist())
        pot [[0.0, 0.0, 0.0], [80.0, 0.0, 0.0]]
        lid [[0.0, 0.0, 0.0], [40.0, 0.0, 0.0]]
    """
    random = np.random.default_rng(seed)
    groups = [[view for own in pixels for view in own]] if settings.shared else pixels
    found = []
    for views in groups:
        cells, counts = color_cells(np.concatenate(views))
        colors = extract_palette(
            cells, counts, settings.colors or None, settings.tolerance, support=cell_support(cells, views)
        )
        if settings.start == "random":
            colors = np.concatenate([colors[:1], random.random((len(colors) - 1, 3), np.float32)])
        found.append(colors)
    return [Palette(name, found[0 if settings.shared else k]) for k, name in enumerate(names)]


def color_histograms(palettes: Sequence[Palette], pixels: Sequence[Sequence[np.ndarray]]) -> dict[str, ColorHistogram]:
    """Return each object's color histogram with palette weights, from its photo colors [n, 3] in each view.

    Examples:
        >>> palette = Palette("pot", np.array([[0, 0, 0], [1, 0, 0]], np.float32))
        >>> histogram = color_histograms([palette], [[np.full((40, 3), [0.5, 0, 0])]])["pot"]
        >>> histogram.counts.tolist(), histogram.palette_weights.tolist()
        ([40], [[0.5, 0.5]])
    """
    histograms = {}
    for palette, views in zip(palettes, pixels, strict=True):
        cells, counts = color_cells(np.concatenate(views))
        histograms[palette.name] = ColorHistogram(cells.astype(np.float32), counts, star_weights(cells, palette.colors))
    return histograms
