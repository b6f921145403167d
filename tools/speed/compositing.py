"""Time of a swatch change at 800 x 800 with 6 colors: the arithmetic alone, without the picture's upload."""

from __future__ import annotations

from functools import partial

import numpy as np

from karf_engine.palettes.compositing import delta_composite

from .rows import Row, median_seconds

SIZE, COLORS = 800, 6


def run(repeats: int = 21) -> list[Row]:
    """Median milliseconds of `delta_composite`, with one swatch changed and with all; a dict a case.

    object: the share of the picture's height that it spans (1 is the worst case).
    """
    random = np.random.default_rng(0)
    base = random.random((SIZE, SIZE, 3), dtype=np.float32)
    learned = random.random((1, COLORS, 3), dtype=np.float32)
    out = np.empty_like(base)
    results = []
    for span in (1.0, 0.5):
        weights = np.zeros((1, COLORS, SIZE, SIZE), np.float32)
        rows = slice(0, int(SIZE * span))
        weights[0, :, rows] = random.dirichlet(np.ones(COLORS), (rows.stop, SIZE)).transpose(2, 0, 1)
        for changed in (1, COLORS):
            edited = learned.copy()
            edited[0, -changed:] = 1 - edited[0, -changed:]
            work = partial(delta_composite, base, weights, learned, edited, out=out)
            milliseconds = round(1000 * median_seconds({"delta": work}, repeats)["delta"], 2)
            results.append({"case": "delta", "object": span, "changed": changed, "median_ms": milliseconds})
    return results
