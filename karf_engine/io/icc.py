"""Convert between sRGB and the space of a photo's embedded ICC profile (ICC.1:2022).

Profiles that `icc_matrix` does not compute, those of tables, gray and CMYK, are left to LittleCMS, which Pillow calls with
8 bits a channel. The rendering intent is relative colorimetric.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from PIL import Image, ImageCms

from .color import to_bytes
from .icc_matrix import MatrixSpace, NotAMatrix, differs_from_srgb, matrix_and_curves, tabulated

# Adobe RGB (1998), which cameras declare by Exif's interoperability index R03 instead of a profile
ADOBE_TO_XYZ = np.array([[0.60974, 0.20528, 0.14919], [0.31111, 0.62567, 0.06322], [0.01947, 0.06087, 0.74457]])
ADOBE_GAMMA = 563 / 256
INTENT = ImageCms.Intent.RELATIVE_COLORIMETRIC


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
        space: Space = MatrixSpace(name, *matrix_and_curves(profile))
    except NotAMatrix:
        space = TableSpace(name, profile)
    try:
        is_other = differs_from_srgb(space.to_srgb)
        space.from_srgb(np.zeros((1, 3)))
    except (ImageCms.PyCMSError, OSError, ValueError):  # also those of other color models
        return None
    return space if is_other else None


def adobe_rgb() -> Space:
    """Return Adobe RGB (1998)."""
    return MatrixSpace("Adobe RGB (1998)", ADOBE_TO_XYZ, np.stack([tabulated(ADOBE_GAMMA)] * 3))


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
