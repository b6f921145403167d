"""Convert between sRGB and the space of a photo's embedded ICC profile (ICC.1:2022).

Profiles of a matrix and three tone curves, as cameras, phones and displays have them, are computed in floats. All others,
those of tables, gray and CMYK, are left to LittleCMS, which Pillow calls with 8 bits a channel. The rendering intent is
relative colorimetric.
"""

from __future__ import annotations

import io
import struct
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from PIL import Image, ImageCms

from .color import linear_to_srgb, srgb_to_linear, to_bytes

SRGB_TO_XYZ = np.array(  # linear sRGB to XYZ adapted to D50: the colorants of the ICC's own sRGB profile
    [[0.43607, 0.38515, 0.14307], [0.22249, 0.71687, 0.06061], [0.01392, 0.09708, 0.71410]]
)
# Adobe RGB (1998), which cameras declare by Exif's interoperability index R03 instead of a profile
ADOBE_TO_XYZ = np.array([[0.60974, 0.20528, 0.14919], [0.31111, 0.62567, 0.06322], [0.01947, 0.06087, 0.74457]])
ADOBE_GAMMA = 563 / 256
STEPS = 1 << 16  # of tabulated curves
UNNOTICED = 1 / 255  # difference to sRGB below which a profile is taken for it
MOST_TAGS = 200
INTENT = ImageCms.Intent.RELATIVE_COLORIMETRIC


class NotAMatrix(Exception):
    """The profile is damaged, or not of a matrix and tone curves."""


@dataclass(frozen=True, eq=False)
class MatrixSpace:
    """An RGB space by its primaries and tone curves, which are tabulated: photos have millions of pixels."""

    name: str
    to_xyz: np.ndarray = field(repr=False)  # linear RGB to XYZ of D50, [3, 3]
    curves: np.ndarray = field(
        repr=False
    )  # linear by encoded values in equal steps, of each channel, float32 [3, STEPS]

    def to_srgb(self, colors: np.ndarray) -> np.ndarray:
        """Convert colors [..., 3] of this space in [0, 1] to sRGB float32, clipped to [0, 1]."""
        matrix = np.linalg.inv(SRGB_TO_XYZ) @ self.to_xyz
        return _convert(colors, self.curves, matrix, np.broadcast_to(_srgb_tables()[1], (3, STEPS)))

    def from_srgb(self, colors: np.ndarray) -> np.ndarray:
        """Convert sRGB to this space, clipped to [0, 1]; the inverse of `to_srgb`."""
        matrix = np.linalg.inv(self.to_xyz) @ SRGB_TO_XYZ
        return _convert(colors, np.broadcast_to(_srgb_tables()[0], (3, STEPS)), matrix, self._inverse)

    @cached_property
    def _inverse(self) -> np.ndarray:
        steps = np.linspace(0, 1, STEPS)
        rising = np.maximum.accumulate(self.curves, axis=1)
        return np.stack([np.interp(steps, curve, steps) for curve in rising]).astype(np.float32)


def _convert(colors: np.ndarray, decode: np.ndarray, matrix: np.ndarray, encode: np.ndarray) -> np.ndarray:
    linear = np.stack([decode[n].take(_index(colors[..., n])) for n in range(3)], -1) @ matrix.T.astype(np.float32)
    return np.stack([encode[n].take(_index(linear[..., n])) for n in range(3)], -1)


def _index(values: np.ndarray) -> np.ndarray:
    return (np.clip(values, 0, 1) * np.float32(STEPS - 1) + np.float32(0.5)).astype(np.int32)


@lru_cache(maxsize=1)
def _srgb_tables() -> tuple[np.ndarray, np.ndarray]:
    steps = np.linspace(0, 1, STEPS)
    return srgb_to_linear(steps).astype(np.float32), linear_to_srgb(steps).astype(np.float32)


@dataclass(frozen=True, eq=False)
class TableSpace:
    """An RGB space by a profile that only LittleCMS reads; as `MatrixSpace`, to the nearest of 8 bits."""

    name: str
    profile: bytes = field(repr=False)

    def to_srgb(self, colors: np.ndarray) -> np.ndarray:
        return self._apply(self._transforms[0], colors)

    def from_srgb(self, colors: np.ndarray) -> np.ndarray:
        return self._apply(self._transforms[1], colors)

    @cached_property
    def _transforms(self) -> tuple[ImageCms.ImageCmsTransform, ImageCms.ImageCmsTransform]:
        own, srgb = _opened(self.profile), ImageCms.createProfile("sRGB")
        forward = ImageCms.buildTransform(own, srgb, "RGB", "RGB", INTENT)
        return forward, ImageCms.buildTransform(srgb, own, "RGB", "RGB", INTENT)

    @staticmethod
    def _apply(transform: ImageCms.ImageCmsTransform, colors: np.ndarray) -> np.ndarray:
        row = Image.fromarray(to_bytes(colors).reshape(1, -1, 3))
        converted = transform.apply(row)
        return (np.asarray(converted, np.float32) / 255).reshape(colors.shape)


Space = MatrixSpace | TableSpace


@lru_cache(maxsize=32)  # the photos of a capture share a profile
def profile_space(profile: bytes) -> Space | None:
    """Return the RGB space of an ICC profile; None if it is sRGB, of another kind, or damaged, as viewers ignore it."""
    name = profile_name(profile)
    try:
        space: Space = MatrixSpace(name, *_matrix_and_curves(profile))
    except NotAMatrix:
        space = TableSpace(name, profile)
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 9)] * 3), -1)
    try:
        difference = np.clip(space.to_srgb(grid), 0, 1) - grid
        space.from_srgb(grid)
    except (ImageCms.PyCMSError, OSError, ValueError):  # also those of other color models
        return None
    return space if np.abs(difference).max() > UNNOTICED else None


def adobe_rgb() -> Space:
    """Return Adobe RGB (1998)."""
    return MatrixSpace("Adobe RGB (1998)", ADOBE_TO_XYZ, np.stack([_tabulated(ADOBE_GAMMA)] * 3))


@lru_cache(maxsize=32)
def profile_name(profile: bytes) -> str:
    """Return the name of an ICC profile; empty if it cannot be read."""
    try:
        return ImageCms.getProfileDescription(_opened(profile)).strip()
    except (ImageCms.PyCMSError, OSError, ValueError):
        return ""


def convert_image(image: Image.Image, profile: bytes) -> Image.Image:
    """Convert a gray or CMYK image by its profile to sRGB; by Pillow's formulas if the profile is damaged."""
    try:
        transform = ImageCms.buildTransform(_opened(profile), ImageCms.createProfile("sRGB"), image.mode, "RGB", INTENT)
        return transform.apply(image)
    except (ImageCms.PyCMSError, OSError, ValueError):
        return image.convert("RGB")


def _opened(profile: bytes) -> ImageCms.ImageCmsProfile:
    return ImageCms.ImageCmsProfile(io.BytesIO(profile))


# ------------------------------------------------------------------------------------------------------------ profiles
def _matrix_and_curves(profile: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Read the colorants and tone curves of a profile. Raises NotAMatrix if it has none, or has tables too."""
    try:
        (count,) = struct.unpack_from(">I", profile, 128)
        entries = [struct.unpack_from(">4sII", profile, 132 + 12 * n) for n in range(min(count, MOST_TAGS))]
        tags = {name: profile[start : start + length] for name, start, length in entries}
        if profile[16:24] != b"RGB XYZ " or b"A2B0" in tags or b"A2B1" in tags:
            raise NotAMatrix
        columns = [struct.unpack_from(">3i", tags[name], 8) for name in (b"rXYZ", b"gXYZ", b"bXYZ")]
        matrix = np.array(columns).T / 65536
        np.linalg.inv(matrix)
        return matrix, np.stack([_curve(tags[name]) for name in (b"rTRC", b"gTRC", b"bTRC")])
    except (struct.error, KeyError, IndexError, ValueError, ZeroDivisionError, np.linalg.LinAlgError) as error:
        raise NotAMatrix from error


def _curve(tag: bytes) -> np.ndarray:
    """Return a tone curve, float32 [STEPS]: of a table, a power, or one of the parametric types 0 to 4."""
    if tag[:4] == b"curv":
        (count,) = struct.unpack_from(">I", tag, 8)
        if count > 1:
            table = np.frombuffer(tag, ">u2", count, 12) / 65535
            return np.interp(np.linspace(0, 1, STEPS), np.linspace(0, 1, count), table).astype(np.float32)
        return _tabulated(struct.unpack_from(">H", tag, 12)[0] / 256 if count else 1.0)
    if tag[:4] != b"para":
        raise NotAMatrix
    (kind,) = struct.unpack_from(">H", tag, 8)
    names = ("g", "g a b", "g a b e", "g a b c d", "g a b c d e f")[kind].split()
    values = struct.unpack_from(f">{len(names)}i", tag, 12)
    return _tabulated(**dict(zip(names, np.array(values) / 65536, strict=True)), is_constant_below=kind in (1, 2))


def _tabulated(
    g: float, a: float = 1, b: float = 0, c: float = 0, d: float = 0, e: float = 0, f: float = 0,
    is_constant_below: bool = False,
) -> np.ndarray:  # fmt: skip
    """Tabulate (a x + b)^g + e from x = d on, c x + f below; `is_constant_below` is e below x = -b / a."""
    x = np.linspace(0, 1, STEPS)
    if is_constant_below:
        d, f = -b / a, e
    return np.where(x >= d, np.maximum(a * x + b, 0) ** g + e, c * x + f).astype(np.float32)
