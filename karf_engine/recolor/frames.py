"""Rendered views as arrays, and supersampled rendering in bands of rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import UNIT_GAINS
from ..fields.scene import Picture
from ..io.arguments import check_array, check_fields
from ..io.color import to_bytes
from ..palettes.compositing import Planes, hard_masks
from ..palettes.palette import Palette

BAND_RAYS = 1 << 20  # rays per band: about half a gigabyte with their surface samples
LONGEST_REPR = 120  # characters


@dataclass(frozen=True)
class Frame:
    """One rendered view of a model with K objects, whose palettes have up to M colors. Arrays are numpy, row 0 on top.

    Attributes:
        picture: the scene as learned, as tensors on the model's device; of a preview smaller than the rest.
        probabilities: [K, H, W] float32, of each object in each pixel (Eq. 8).
        palette_weights: [K, M, H, W] float32, probabilities times weights (Eq. 9); None before palettes are learned.
        base: [H, W, 3] float32 sRGB in [0, 1], the picture that an edit changes: the photo, or the rendering.
        disputed: objects about which photo and field disagree; their edges are the field's.
        camera, supersampling, fades: what `Model.render` was given, of a frame rendered from splats.
        gains: exposure of the base, see `View`; weights and palettes are of the mean exposure.
        visibility: [H, W] float32 in [0, 1], how well the photos cover what the pixel shows; None without splats.

    Raises TypeError if a field has the wrong type, BadRequest if an array has the wrong shape.

    Example:
        frame = model.render(model.capture.views[0].camera)
        pot = frame.probabilities[model.objects.index("pot")]  # [H, W] in [0, 1]
    """

    picture: Picture
    probabilities: np.ndarray
    palette_weights: np.ndarray | None
    base: np.ndarray
    disputed: tuple[str, ...] = ()
    camera: Camera | None = field(default=None, kw_only=True)
    supersampling: int = field(default=1, kw_only=True)
    fades: bool | None = field(default=None, kw_only=True)
    gains: tuple[float, float, float] = field(default=UNIT_GAINS, kw_only=True)
    visibility: np.ndarray | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        check_fields(self)
        check_array("base", self.base, ("H", "W", 3))
        shape = self.base.shape[:2]
        check_array("probabilities", self.probabilities, ("K", *shape))
        if self.palette_weights is not None:
            check_array("palette_weights", self.palette_weights, (len(self.probabilities), "M", *shape))

    def __repr__(self) -> str:
        height, width = self.base.shape[:2]
        return f"Frame({width}x{height}, {len(self.probabilities)} objects)"

    @property
    def color(self) -> np.ndarray:
        """The scene as learned, [H, W, 3] float32 sRGB in [0, 1]."""
        return self.picture.color.cpu().numpy()

    @property
    def depth(self) -> np.ndarray:
        """Depth along the optical axis, [H, W] float32, world units; 0 where empty."""
        return self.picture.depth.cpu().numpy().astype(np.float32)

    @property
    def opacity(self) -> np.ndarray:
        """Accumulated opacity of each pixel's ray, [H, W] float32 in [0, 1]."""
        return self.picture.opacity.cpu().numpy()

    @property
    def masks(self) -> np.ndarray:
        """Mask of each object where it is the most probable class, [K, H, W] bool (argmax of Eq. 8)."""
        return hard_masks(self.probabilities)


@dataclass(frozen=True)
class Layers:
    """A recolorable view of K objects, whose palettes have up to M colors, as the layers of one picture."""

    palettes: tuple[Palette, ...]  # of the objects as learned
    base: np.ndarray  # [H, W, 3] sRGB, the picture that an edit changes: uint8, uint16, or float in [0, 1]
    coverage: np.ndarray  # [K, H, W] in [0, 1], any float
    palette_weights: np.ndarray  # [K, M, H, W], coverage times weights, any float; padding is not read
    depth: np.ndarray | None = None  # [H, W] along the optical axis, world units, 0 where empty
    gains: tuple[float, float, float] = UNIT_GAINS  # exposure of the base: they multiply the changes of palettes


def one_line(name: str, content: str) -> str:
    """Return `name(content)` as one line of at most `LONGEST_REPR` characters, for a `__repr__`."""
    content, room = " ".join(content.split()), LONGEST_REPR - len(name) - 2
    return f"{name}({content if len(content) <= room else content[: room - 3] + '...'})"


def edit_planes(frame: Frame, objects: Sequence[str]) -> Planes:
    weights, probabilities = frame.palette_weights, frame.probabilities
    if weights is None:
        weights = np.zeros((len(objects), 0, *probabilities.shape[1:]))
    planes = weights.astype(np.float16), probabilities.astype(np.float16)
    return Planes(tuple(objects), *planes, to_bytes(frame.base), frame.gains)


def split_bands(camera: Camera, supersampling: int, most_rays: int = BAND_RAYS) -> list[Camera]:
    """Split a camera, scaled up by the supersampling factor, into bands of rows."""
    fine = camera.scaled(camera.width * supersampling, camera.height * supersampling)
    rows = max(1, most_rays // (fine.width * supersampling)) * supersampling
    if rows >= fine.height:
        return [fine]
    tops = range(0, fine.height, rows)
    return [replace(fine, height=min(rows, fine.height - top), cy=fine.cy - top) for top in tops]


def downsample(frame: Frame, count: int) -> Frame:
    """Reduce each count x count block of pixels to its mean; depth to the median of its nonzero values."""
    if count == 1:
        return frame
    picture = frame.picture
    color = _means(picture.color.permute(2, 0, 1).cpu().numpy(), count).transpose(1, 2, 0)
    weights = None if frame.palette_weights is None else _means(frame.palette_weights, count)
    coarse = Picture(
        torch.from_numpy(np.ascontiguousarray(color)),
        torch.from_numpy(_means(frame.opacity, count)),
        torch.from_numpy(_medians(frame.depth, count)),
        None,
    )
    seen = None if frame.visibility is None else _means(frame.visibility, count)
    return Frame(coarse, _means(frame.probabilities, count), weights, color, visibility=seen)


def stack_bands(bands: Sequence[Frame]) -> Frame:
    """Stack bands of rows into one frame, without a surface cache."""
    color, opacity, depth = (
        torch.cat([getattr(band.picture, name) for band in bands]) for name in ("color", "opacity", "depth")
    )
    weights = _stacked([band.palette_weights for band in bands], -2)
    seen = _stacked([band.visibility for band in bands], 0)
    probabilities = np.concatenate([band.probabilities for band in bands], -2)
    return Frame(Picture(color, opacity, depth, None), probabilities, weights, color.cpu().numpy(), visibility=seen)


def _stacked(parts: Sequence[np.ndarray | None], axis: int) -> np.ndarray | None:
    arrays = [part for part in parts if part is not None]
    return np.concatenate(arrays, axis) if arrays else None


def remove_background(color: np.ndarray, opacity: np.ndarray, behind: np.ndarray) -> np.ndarray:
    """Remove the background [H, W, 3] from a rendering: straight sRGB and alpha, [H, W, 4] float32 in [0, 1].

    color: [H, W, 3], the scene over its background, possibly edited. opacity: [H, W], of the scene.
    """
    alpha = opacity[..., None]
    covered = color - (1 - alpha) * behind
    straight = np.divide(covered, alpha, out=np.zeros_like(covered), where=alpha > 0)
    return np.concatenate([np.clip(straight, 0, 1), alpha], -1).astype(np.float32)


def _blocks(values: np.ndarray, count: int) -> np.ndarray:
    """Group [.., H, W] to blocks of pixels, [.., h, w, count * count]."""
    height, width = values.shape[-2] // count, values.shape[-1] // count
    split = values.reshape(*values.shape[:-2], height, count, width, count)
    return split.swapaxes(-3, -2).reshape(*values.shape[:-2], height, width, count * count)


def _means(values: np.ndarray, count: int) -> np.ndarray:
    return _blocks(values, count).mean(-1, dtype=np.float32)


def _medians(depth: np.ndarray, count: int) -> np.ndarray:
    """Return the lower median of each block's nonzero depths, or 0: a mean would lie between two surfaces."""
    blocks = np.sort(_blocks(depth, count), -1)
    hits = (blocks > 0).sum(-1, keepdims=True)
    middle = np.where(hits > 0, blocks.shape[-1] - hits + (hits - 1) // 2, 0)
    return np.take_along_axis(blocks, middle, -1)[..., 0]
