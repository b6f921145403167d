"""Colors as clipboard text: `#rrggbb`, or CSS's `color(srgb r g b)` beyond white."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from .palette import MAX_SRGB, hex_to_rgb, rgb_to_hex

# CSS Color Module Level 4, 10.2; # is optional, as in color lists of web addresses
PATTERN = re.compile(r"color\(\s*srgb((?:\s+\d*\.?\d+){3})\s*\)|(?<![0-9a-z])#?([0-9a-f]{6})(?![0-9a-z])", re.I)


def color_to_text(color: Sequence[float] | np.ndarray) -> str:
    """Format an sRGB color [3] in [0, BRIGHTEST]; colors up to white are rounded to 8 bits.

    Examples:
        >>> color_to_text([1.0, 0.0, 0.2]), color_to_text([1.5, 0.25, 0.0])
        ('#ff0033', 'color(srgb 1.5 0.25 0)')
    """
    if max(color) <= 1:
        return rgb_to_hex(np.asarray(color))
    return "color(srgb {:.5g} {:.5g} {:.5g})".format(*map(float, color))


def colors_of_text(text: str) -> np.ndarray:
    """Parse all colors in a text, sRGB [n, 3] float32 in [0, BRIGHTEST]; other text is ignored.

    Examples:
        >>> colors_of_text("color(srgb 1.5 0.25 0); Pot: #FF0000, 00ff00-0000ff").tolist()
        [[1.5, 0.25, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    found = [np.array(wide.split(), np.float32) if wide else hex_to_rgb(short) for wide, short in PATTERN.findall(text)]
    return np.clip(np.array(found, np.float32).reshape(-1, 3), 0, MAX_SRGB)
