"""Color conversion between sRGB, linear light and CIE L*a*b*, and the CIEDE2000 difference. Needs numpy only.

Colors are arrays [..., 3]; "sRGB" is display-referred, "linear" is scene-linear with Rec. 709 primaries. Results are
float64. Ranges inside the sRGB gamut: sRGB and linear 0..1; XYZ 0..0.9505, 0..1, 0..1.0888 (D65, 2 degree observer);
L* 0..100, a* -86.2..98.2, b* -107.9..94.5; hue -pi..pi radians.
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
# the white point of sRGB (1, 1, 1) itself, so that a* = b* = 0 exactly for greys
_WHITE = _LINEAR_TO_XYZ.sum(axis=1)
_WHITE_D50 = np.array([0.9642, 1.0, 0.8249])  # ICC.1:2022, 7.2.16
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


def to_bytes(color: np.ndarray) -> np.ndarray:
    """Quantize sRGB colors in [0, 1] to uint8, clipped and rounded."""
    return np.rint(np.clip(color, 0, 1) * 255).astype(np.uint8)


def srgb_to_linear(color: np.ndarray) -> np.ndarray:
    """Decode sRGB to scene-linear values (IEC 61966-2-1); negative values are scaled linearly."""
    color = np.asarray(color, np.float64)
    return np.where(color <= 0.04045, color / 12.92, ((np.maximum(color, 0) + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(color: np.ndarray) -> np.ndarray:
    """Encode scene-linear values as sRGB, not clipped; the inverse of `srgb_to_linear`."""
    color = np.asarray(color, np.float64)
    return np.where(color <= 0.0031308, 12.92 * color, 1.055 * np.maximum(color, 0.0031308) ** (1 / 2.4) - 0.055)


def srgb_to_lab(color: np.ndarray) -> np.ndarray:
    """Convert sRGB in [0, 1] to CIE L*a*b* (D65)."""
    return _lab_of_ratio(srgb_to_linear(color) @ _LINEAR_TO_XYZ.T / _WHITE)


def lab_to_srgb(lab: np.ndarray) -> np.ndarray:
    """Convert CIE L*a*b* (D65) to sRGB, not clipped: colors out of gamut leave 0..1."""
    return linear_to_srgb(_ratio_of_lab(lab) * _WHITE @ np.linalg.inv(_LINEAR_TO_XYZ).T)


def lab_d50_to_d65(lab: np.ndarray) -> np.ndarray:
    """Adapt CIE L*a*b* from the white D50 of ICC profiles and Adobe files to D65 (Bradford; ICC.1:2022, annex E)."""
    cones = _ratio_of_lab(lab) * _WHITE_D50 @ _BRADFORD.T
    adapted = cones * (_BRADFORD @ _WHITE) / (_BRADFORD @ _WHITE_D50)
    return _lab_of_ratio(adapted @ np.linalg.inv(_BRADFORD).T / _WHITE)


def _lab_of_ratio(ratio: np.ndarray) -> np.ndarray:
    """Convert XYZ relative to the white point to CIE L*a*b*."""
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    x, y, z = f[..., 0], f[..., 1], f[..., 2]
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def _ratio_of_lab(lab: np.ndarray) -> np.ndarray:
    """The inverse of `_lab_of_ratio`."""
    lab = np.asarray(lab, np.float64)
    y = (lab[..., 0] + 16) / 116
    f = np.stack([y + lab[..., 1] / 500, y, y - lab[..., 2] / 200], axis=-1)
    return np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))


def lab_hue(lab: np.ndarray) -> np.ndarray:
    """Return the hue angle of Lab colors in radians, -pi..pi; 0 for exact greys."""
    return np.arctan2(lab[..., 2], lab[..., 1])


def lab_chroma(lab: np.ndarray) -> np.ndarray:
    """Return the chroma of Lab colors, 0..134 inside the sRGB gamut."""
    return np.hypot(lab[..., 1], lab[..., 2])


def lab_saturation(lab: np.ndarray) -> np.ndarray:
    """Return the saturation C / sqrt(C^2 + L^2) of Lab colors (Luebbe 2011), in [0, 1) and nearly shading-invariant."""
    chroma = lab_chroma(lab)
    length = np.hypot(chroma, lab[..., 0])
    return np.divide(chroma, length, out=np.zeros_like(length), where=length > 0)


def ciede2000(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the color difference CIEDE2000 of two arrays of Lab colors; about 1 is just noticeable.

    Sharma, Wu and Dalal (2005), "The CIEDE2000 color-difference formula"; k_L = k_C = k_H = 1.
    """
    first, second = np.broadcast_arrays(np.asarray(first, np.float64), np.asarray(second, np.float64))
    grey = ((lab_chroma(first) + lab_chroma(second)) / 2) ** 7
    stretch = np.array(1 + 0.5 * (1 - np.sqrt(grey / (grey + 25.0**7))))
    (c1, h1), (c2, h2) = (
        (np.hypot(lab[..., 1] * stretch, lab[..., 2]), np.arctan2(lab[..., 2], lab[..., 1] * stretch))
        for lab in (first, second)
    )
    turn = (h2 - h1 + np.pi) % (2 * np.pi) - np.pi
    d_light, d_chroma, d_hue = second[..., 0] - first[..., 0], c2 - c1, 2 * np.sqrt(c1 * c2) * np.sin(turn / 2)
    light, chroma = (first[..., 0] + second[..., 0]) / 2, (c1 + c2) / 2
    hue = np.where(c1 * c2 == 0, h1 + h2, h1 + turn / 2)
    waves = ((-0.17, 1, -30), (0.24, 2, 0), (0.32, 3, 6), (-0.20, 4, -63))
    t = 1 + sum(height * np.cos(n * hue + np.radians(shift)) for height, n, shift in waves)
    offset = (light - 50) ** 2
    s_light = 1 + 0.015 * offset / np.sqrt(20 + offset)
    s_chroma, s_hue = 1 + 0.045 * chroma, 1 + 0.015 * chroma * t
    from_blue = (np.degrees(hue) % 360 - 275) / 25
    rotation = -2 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7)) * np.sin(np.radians(60) * np.exp(-(from_blue**2)))
    d_light, d_chroma, d_hue = d_light / s_light, d_chroma / s_chroma, d_hue / s_hue
    return np.sqrt(d_light**2 + d_chroma**2 + d_hue**2 + rotation * d_chroma * d_hue)
