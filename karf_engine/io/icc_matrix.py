"""Color spaces of ICC profiles (ICC.1:2022) of a matrix and three tone curves, as cameras, phones and displays have them.

They are computed in floats, with numpy alone: Blender has no LittleCMS.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from .color import linear_to_srgb, srgb_to_linear

SRGB_TO_XYZ = np.array(  # linear sRGB to XYZ adapted to D50: the colorants of the ICC's own sRGB profile
    [[0.43607, 0.38515, 0.14307], [0.22249, 0.71687, 0.06061], [0.01392, 0.09708, 0.71410]]
)
STEPS = 1 << 16  # of tabulated curves
UNNOTICED = 1 / 255  # difference to sRGB below which a profile is taken for it
MOST_TAGS = 200


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


@lru_cache(maxsize=32)  # the photos of a capture share a profile
def matrix_space(profile: bytes) -> MatrixSpace | None:
    """Return the space of such a profile; None if it is sRGB, of another kind, or damaged."""
    try:
        space = MatrixSpace("", *matrix_and_curves(profile))
    except NotAMatrix:
        return None
    return space if differs_from_srgb(space.to_srgb) else None


def differs_from_srgb(to_srgb: Callable[[np.ndarray], np.ndarray]) -> bool:
    """Test whether a conversion to sRGB changes colors visibly."""
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 9)] * 3), -1)
    return bool(np.abs(np.clip(to_srgb(grid), 0, 1) - grid).max() > UNNOTICED)


def matrix_and_curves(profile: bytes) -> tuple[np.ndarray, np.ndarray]:
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
        return tabulated(struct.unpack_from(">H", tag, 12)[0] / 256 if count else 1.0)
    if tag[:4] != b"para":
        raise NotAMatrix
    (kind,) = struct.unpack_from(">H", tag, 8)
    names = ("g", "g a b", "g a b e", "g a b c d", "g a b c d e f")[kind].split()
    values = struct.unpack_from(f">{len(names)}i", tag, 12)
    return tabulated(**dict(zip(names, np.array(values) / 65536, strict=True)), is_constant_below=kind in (1, 2))


def tabulated(
    g: float, a: float = 1, b: float = 0, c: float = 0, d: float = 0, e: float = 0, f: float = 0,
    is_constant_below: bool = False,
) -> np.ndarray:  # fmt: skip
    """Tabulate (a x + b)^g + e from x = d on, c x + f below; `is_constant_below` is e below x = -b / a."""
    x = np.linspace(0, 1, STEPS)
    if is_constant_below:
        d, f = -b / a, e
    return np.where(x >= d, np.maximum(a * x + b, 0) ** g + e, c * x + f).astype(np.float32)
