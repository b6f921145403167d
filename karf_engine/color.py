"""Color spaces, color difference, and the hue shift that other tools offer as a baseline.

Colors are arrays [..., 3]; "sRGB" is display-referred, "linear" is scene-linear with Rec. 709 primaries. Results are
float64. Domains and ranges:

    space     channels        domain used here
    sRGB      r, g, b         0..1 each   (IEC 61966-2-1)
    linear    r, g, b         0..1 each
    XYZ       X, Y, Z         0..0.9505, 0..1, 0..1.0888   (white D65, 2 degree observer)
    Lab       L*, a*, b*      0..100, -86.2..98.2, -107.9..94.5   (for colors inside the sRGB cube)
    hue       radians         -pi..pi
"""

from __future__ import annotations

import numpy as np

# IEC 61966-2-1
_LINEAR_TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
# the white is that of sRGB (1, 1, 1) itself, so that greys have a* = b* = 0 exactly
_WHITE = _LINEAR_TO_XYZ.sum(axis=1)


def to_bytes(color: np.ndarray) -> np.ndarray:
    """8-bit values of sRGB colors in [0, 1], clipped and rounded (cutting would darken by half a level), uint8.

    Examples:
        >>> to_bytes(np.array([-0.1, 0.5, 0.999, 1.2])).tolist()
        [0, 128, 255, 255]
    """
    return np.rint(np.clip(color, 0, 1) * 255).astype(np.uint8)


def srgb_to_linear(color: np.ndarray) -> np.ndarray:
    """Scene-linear values of sRGB [..., 3]; 0..1 maps to 0..1 (IEC 61966-2-1). Negative values are scaled linearly.

    Examples:
        >>> srgb_to_linear(np.array([0.0, 0.5, 1.0])).round(4).tolist()
        [0.0, 0.214, 1.0]
    """
    color = np.asarray(color, np.float64)
    return np.where(color <= 0.04045, color / 12.92, ((np.maximum(color, 0) + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(color: np.ndarray) -> np.ndarray:
    """sRGB of scene-linear values [..., 3]; the inverse of `srgb_to_linear`, not clipped.

    Examples:
        >>> linear_to_srgb(np.array([0.0, 0.18, 1.0])).round(4).tolist()
        [0.0, 0.4614, 1.0]
    """
    color = np.asarray(color, np.float64)
    return np.where(color <= 0.0031308, 12.92 * color, 1.055 * np.maximum(color, 0.0031308) ** (1 / 2.4) - 0.055)


def srgb_to_lab(color: np.ndarray) -> np.ndarray:
    """CIE L*a*b* (white D65) of sRGB [..., 3] in [0, 1].

    | domain      | range                                    |
    |-------------|------------------------------------------|
    | sRGB 0..1   | L* 0..100, a* -86.2..98.2, b* -107.9..94.5 |

    Examples:
        >>> print(srgb_to_lab(np.array([[1.0, 1, 1], [1, 0, 0]])).round(2) + 0.0)
        [[100.     0.     0.  ]
         [ 53.24  80.09  67.2 ]]
    """
    ratio = srgb_to_linear(color) @ _LINEAR_TO_XYZ.T / _WHITE
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    x, y, z = f[..., 0], f[..., 1], f[..., 2]
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def lab_hue(lab: np.ndarray) -> np.ndarray:
    """Hue angle of Lab colors [..., 3] in radians, -pi..pi; 0 for exact greys.

    Examples:
        >>> np.degrees(lab_hue(np.array([[50.0, 10, 0], [50, 0, 10]]))).tolist()
        [0.0, 90.0]
    """
    return np.arctan2(lab[..., 2], lab[..., 1])


def lab_chroma(lab: np.ndarray) -> np.ndarray:
    """Chroma of Lab colors [..., 3]: distance from the grey axis, 0..134 inside the sRGB cube.

    Examples:
        >>> float(lab_chroma(np.array([50.0, 3, 4])))
        5.0
    """
    return np.hypot(lab[..., 1], lab[..., 2])


def ciede2000(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """CIEDE2000 color difference of two Lab arrays [..., 3] that broadcast; symmetric (Sharma, Wu, Dalal 2005).

    | domain                             | range                                        |
    |------------------------------------|----------------------------------------------|
    | L* 0..100, a* and b* -128..128     | 0..about 120; 1 is about just noticeable     |

    Examples:
        The first pair of the paper's test data:

        >>> round(float(ciede2000([50, 2.6772, -79.7751], [50, 0, -82.7485])), 4)
        2.0425
    """
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    chroma_mean = (lab_chroma(first) + lab_chroma(second)) / 2
    g = 0.5 * (1 - np.sqrt(chroma_mean**7 / (chroma_mean**7 + 25.0**7)))
    a1, a2 = (1 + g) * first[..., 1], (1 + g) * second[..., 1]
    b1, b2 = first[..., 2], second[..., 2]
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360, np.degrees(np.arctan2(b2, a2)) % 360

    grey = c1 * c2 == 0
    turn = (h2 - h1 + 180) % 360 - 180
    # hues count as opposite, and keep their sign, within the rounding of the angles themselves
    opposite = np.abs(np.abs(h2 - h1) - 180) < 1e-9
    turn = np.where(grey, 0, np.where(opposite, h2 - h1, turn))
    d_lightness = second[..., 0] - first[..., 0]
    d_chroma = c2 - c1
    d_hue = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2))

    lightness, chroma = (first[..., 0] + second[..., 0]) / 2, (c1 + c2) / 2
    far = (np.abs(h1 - h2) > 180) & ~opposite
    hue = (h1 + h2) / 2 + np.where(far, np.where(h1 + h2 < 360, 180, -180), 0)
    hue = np.where(grey, h1 + h2, hue)
    t = (
        1
        - 0.17 * np.cos(np.radians(hue - 30))
        + 0.24 * np.cos(np.radians(2 * hue))
        + 0.32 * np.cos(np.radians(3 * hue + 6))
        - 0.20 * np.cos(np.radians(4 * hue - 63))
    )
    s_lightness = 1 + 0.015 * (lightness - 50) ** 2 / np.sqrt(20 + (lightness - 50) ** 2)
    s_chroma = 1 + 0.045 * chroma
    s_hue = 1 + 0.015 * chroma * t
    rotation = np.sin(np.radians(60 * np.exp(-(((hue - 275) / 25) ** 2))))
    r_t = -2 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7)) * rotation
    l_term, c_term, h_term = d_lightness / s_lightness, d_chroma / s_chroma, d_hue / s_hue
    return np.sqrt(np.maximum(l_term**2 + c_term**2 + h_term**2 + r_t * c_term * h_term, 0))


def rgb_to_hsv(color: np.ndarray) -> np.ndarray:
    """Hue, saturation, value, each in [0, 1], of RGB [..., 3] in [0, 1]; hue 0 for greys.

    Examples:
        >>> rgb_to_hsv(np.array([[0.0, 1, 0], [0.5, 0.5, 0.5]])).round(4).tolist()
        [[0.3333, 1.0, 1.0], [0.0, 0.0, 0.5]]
    """
    color = np.asarray(color, np.float64)
    value = color.max(axis=-1)
    chroma = value - color.min(axis=-1)
    safe = np.where(chroma > 0, chroma, 1)
    r, g, b = ((value - color[..., i]) / safe for i in range(3))
    hue = np.select([color[..., 0] == value, color[..., 1] == value], [b - g, 2 + r - b], 4 + g - r)
    hue = np.where(chroma > 0, hue / 6 % 1, 0)
    return np.stack([hue, chroma / np.where(value > 0, value, 1), value], axis=-1)


def hsv_to_rgb(color: np.ndarray) -> np.ndarray:
    """RGB [..., 3] in [0, 1] of hue, saturation, value in [0, 1]; hue wraps.

    Examples:
        >>> hsv_to_rgb(np.array([1 / 3, 1.0, 0.5])).round(4).tolist()
        [0.0, 0.5, 0.0]
    """
    color = np.asarray(color, np.float64)
    hue, saturation, value = color[..., 0], color[..., 1], color[..., 2]
    sector = (np.array([5.0, 3.0, 1.0]) + 6 * hue[..., None]) % 6
    return value[..., None] * (1 - saturation[..., None] * np.clip(np.minimum(sector, 4 - sector), 0, 1))


def hue_shift(image: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The usual recipe, as a baseline: rotate every pixel's HSV hue by the hue difference of target and source.

    Args:
        image: sRGB [..., 3] in [0, 1].
        source: sRGB [3] in [0, 1].
        target: sRGB [3] in [0, 1].

    Returns:
        sRGB [..., 3] in [0, 1].

    Examples:
        >>> red, blue = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
        >>> hue_shift(red / 2, source=red, target=blue).round(4).tolist()
        [0.0, 0.0, 0.5]
    """
    hsv = rgb_to_hsv(image)
    hsv[..., 0] = (hsv[..., 0] + rgb_to_hsv(target)[0] - rgb_to_hsv(source)[0]) % 1
    return hsv_to_rgb(hsv)
