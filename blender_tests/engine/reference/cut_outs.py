"""Painted scenes with known coverage: shapes drawn at a multiple of the photo's size, mixed in linear light."""

from dataclasses import dataclass

import cv2
import numpy as np

from karf_engine.io.color import linear_to_srgb, srgb_to_linear, to_bytes

FINE = 8  # sub-pixels along a side of a photo's pixel


@dataclass(frozen=True)
class CutOut:
    """A photo, the true coverage of its objects, and the prediction of a smaller field."""

    photo: np.ndarray  # uint8 [H, W, 3]
    coverage: np.ndarray  # [K, H, W] in [0, 1]
    probabilities: np.ndarray  # [K, h, w]
    rendered: np.ndarray  # uint8 [h, w, 3]


def paint(
    shapes: list[np.ndarray],  # bool [H * FINE, W * FINE], where each object is
    colors: list[tuple[int, int, int]],  # of each object, sRGB of 255
    behind: np.ndarray,  # uint8 [H, W, 3]
    field: list[np.ndarray],  # the shapes as the field learned them, perhaps with parts missing
    size: int,  # height and width of the field's picture
) -> CutOut:
    """A photo of objects that do not overlap."""
    height, width = behind.shape[:2]
    coverage = np.stack([_reduced(shape, (width, height)) for shape in shapes])
    probabilities = np.stack([_reduced(shape, (size, size)) for shape in field])
    learned = np.stack([_reduced(shape, (width, height)) for shape in field])
    noise = np.random.default_rng(0).normal(0, 1.5, behind.shape)
    photo = np.rint(_mixed(coverage, colors, behind) + noise).clip(0, 255).astype(np.uint8)
    rendered = cv2.resize(_mixed(learned, colors, behind), (size, size), interpolation=cv2.INTER_AREA)
    return CutOut(photo, coverage, probabilities, rendered)


def canvas(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows of the sub-pixels of a photo of this size, in units of pixels."""
    rows, columns = (np.indices((size * FINE, size * FINE)) + 0.5) / FINE
    return columns, rows


def _reduced(shape: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    return cv2.resize(shape.astype(np.float32), size, interpolation=cv2.INTER_AREA)


def _mixed(coverage: np.ndarray, colors: list[tuple[int, int, int]], behind: np.ndarray) -> np.ndarray:
    light = srgb_to_linear(behind / 255) * (1 - coverage.sum(0))[..., None]
    for own, color in zip(coverage, colors, strict=True):
        light += own[..., None] * srgb_to_linear(np.array(color) / 255)
    return to_bytes(linear_to_srgb(light))
