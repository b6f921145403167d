"""Frames rendered from the radiance field, with the outputs of F_s and F_w."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import UNIT_GAINS
from ..capture.distortion import undistort_points
from ..capture.training_images import TrainingImage
from ..errors import BadRequest
from ..fields.rendering.rays import camera_rays
from ..fields.rendering.surface_cache import SurfaceCache
from ..fields.scene import Picture
from ..heads.rendering import ObjectSamples, object_samples, segment_cache, weigh_cache
from ..io.arguments import check_array
from ..io.color import to_bytes
from ..io.images import alpha_composite
from .frames import BAND_RAYS, Frame, downsample, split_bands, stack_bands
from .full_resolution import dense_weights
from .learned import UNTRAINED, Learned

MASK_SAMPLES, WEIGHT_SAMPLES = 3, 8  # quantile samples per ray, for classes and for palette weights


def in_bands(render: Callable[[Camera], Frame], pinhole: Camera, supersampling: int) -> Frame:
    """Render a supersampled pinhole in bands of rows that fit in memory."""
    frames = [downsample(render(band), supersampling) for band in split_bands(pinhole, supersampling)]
    return frames[0] if len(frames) == 1 else stack_bands(frames)


def field_frame(learned: Learned, pinhole: Camera) -> Frame:
    """Render a pinhole with palette weights by F_w, where it is trained; its base is the rendering."""
    picture = learned.scene.render(pinhole, WEIGHT_SAMPLES if learned.palettes else MASK_SAMPLES)
    return frame_of(learned, picture, picture.color.cpu().numpy(), from_field=True)


def photo_frame(learned: Learned, training_image: TrainingImage, weights_from: str = "photo") -> Frame:
    """Render the view of a loaded photo, with the photo as base.

    weights_from: palette weights by the photo's colors (`photo`), or by F_w where it is trained (`field`).
    """
    from_field = bool(learned.palettes) and weights_from == "field"
    picture = learned.scene.render(training_image.camera, WEIGHT_SAMPLES if from_field else MASK_SAMPLES)
    base = alpha_composite(training_image.color, training_image.alpha)  # over the background of renderings
    return frame_of(learned, picture, base, from_field, gains=training_image.view.gains)


def segmented_frame(learned: Learned, camera: Camera) -> Frame:
    """Render a camera with its lens distortion, without palette weights; its base is the rendering."""
    picture = learned.scene.render(camera, MASK_SAMPLES)
    frame = Frame(picture, probabilities_of(learned, picture), None, picture.color.cpu().numpy())
    if not camera.is_pinhole:  # pixels that the distortion model cannot invert have no ray
        beyond = np.isnan(undistort_points(camera, camera.pixel_centers())).any(1).reshape(frame.depth.shape)
        frame.probabilities[:, beyond] = 0
    return frame


def frame_of(
    learned: Learned,
    picture: Picture,
    base: np.ndarray,
    from_field: bool,
    *,
    gains: tuple[float, float, float] = UNIT_GAINS,
) -> Frame:
    """Add probabilities and palette weights to a picture that the scene has rendered.

    Args:
        learned: What is learned.
        picture: With its surface cache.
        base: [H, W, 3] sRGB in [0, 1], of the picture's size.
        from_field: Palette weights by F_w, where it is trained, else by the colors of the base.
        gains: Exposure of the base, see `View`.

    Raises:
        BadRequest: The base has another size, or the picture has no surface cache.
    """
    check_array("base", base, (*picture.opacity.shape, 3))
    samples, weights = None, None
    if learned.recoloring is not None and from_field:
        samples = _object_samples(learned, picture)
    probabilities = probabilities_of(learned, picture, samples)
    if samples is not None:
        weights = weights_of_field(learned, picture, samples)
    elif learned.palettes:
        weights = weights_of_colors(learned, base, probabilities, gains=gains)
    return Frame(picture, probabilities, weights, base, gains=gains)


def probabilities_of(learned: Learned, picture: Picture, samples: ObjectSamples | None = None) -> np.ndarray:
    """Return object probabilities [K, H, W] float32 by F_s (Eq. 8). samples: of the picture, if known."""
    height, width = picture.opacity.shape
    result = np.zeros((len(learned.objects), height * width), np.float32)
    if learned.segmentation is not None:
        cache = _cache_of(picture)
        known = samples is not None
        classes = samples.rendered if known else segment_cache(learned.segmentation, learned.scene.field, cache)
        result[:, cache.index.cpu().numpy()] = classes[:, 1:].T.cpu().numpy()
    return result.reshape(-1, height, width)


def weights_of_colors(
    learned: Learned, base: np.ndarray, probabilities: np.ndarray, *, gains: tuple[float, float, float] = UNIT_GAINS
) -> np.ndarray:
    """Return palette weights [K, M, H, W] by the colors of a picture [H, W, 3], times probabilities [K, H, W]."""
    return dense_weights([to_bytes(base)] * len(learned.objects), learned.palettes, probabilities, gains)


def weights_of_field(learned: Learned, picture: Picture, samples: ObjectSamples | None = None) -> np.ndarray:
    """Return palette weights [K, M, H, W] by F_w (Eq. 9), times probabilities. samples: of the picture, if known.

    Raises BadRequest where F_w is not trained.
    """
    if learned.recoloring is None:
        raise BadRequest(*UNTRAINED, folder=learned.project.folder)
    height, width = picture.opacity.shape
    cache = _cache_of(picture)
    samples = _object_samples(learned, picture) if samples is None else samples
    planes = weigh_cache(learned.recoloring, samples, cache)
    weights = np.zeros((*planes.shape[1:], height * width), np.float32)
    weights[..., cache.index.cpu().numpy()] = planes.permute(1, 2, 0).cpu().numpy()
    return weights.reshape(*planes.shape[1:], height, width)


@torch.no_grad()
def background(learned: Learned, pinhole: Camera) -> np.ndarray:
    """Render what is behind the field, [H, W, 3] float32 sRGB."""
    rays = camera_rays(pinhole, learned.device)
    colors = [learned.scene.background_color(some) for some in rays.viewdirs.split(BAND_RAYS)]
    return torch.cat(colors).cpu().numpy().reshape(pinhole.height, pinhole.width, 3)


def label_uncertainty(learned: Learned, pinhole: Camera, frame: Frame) -> np.ndarray:
    """Return the uncertainty of each object's label at a frame's depth, [K, H, W] float32 in [0, 1]."""
    learned.check_frame(frame)
    check_array("frame.depth", frame.depth, (pinhole.height, pinhole.width))
    origins, directions = pinhole.rays(pinhole.pixel_centers())
    doubts = learned.doubts.at(origins + frame.depth.reshape(-1, 1) * directions)
    return np.ascontiguousarray(doubts.T).reshape(-1, *frame.depth.shape) * frame.opacity


def _object_samples(learned: Learned, picture: Picture) -> ObjectSamples:
    assert learned.segmentation is not None
    return object_samples(learned.segmentation, learned.scene.field, _cache_of(picture))


def _cache_of(picture: Picture) -> SurfaceCache:
    if picture.cache is None:
        raise BadRequest("The picture has no surface samples.", "Render it by scene.render.")
    return picture.cache
