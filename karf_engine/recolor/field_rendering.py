"""A learned project in memory, and frames rendered from its field with the outputs of F_s and F_w."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import UNIT_GAINS, Capture
from ..capture.distortion import undistort_points
from ..capture.training_images import TrainingImage
from ..compute.cores import limit_torch_threads
from ..errors import BadRequest
from ..fields.files import load_scene
from ..fields.rendering.surface_cache import SurfaceCache
from ..fields.scene import Picture
from ..heads.fields import RecoloringField, SegmentationField
from ..heads.files import load_recoloring, load_segmentation
from ..heads.rendering import ObjectSamples, object_samples, segment_cache, weigh_cache
from ..io.arguments import check_array
from ..io.color import to_bytes
from ..io.images import alpha_composite
from ..palettes.compositing import stack_palettes
from ..palettes.palette import Edit, Palette, check_edit, read_palettes
from ..project import Project
from ..project.contents import read_capture, settings_for
from ..project.settings import Settings
from ..segmentation.surface_points import SurfaceUncertainty
from ..splats.files import load_gaussians
from ..splats.gaussians import Gaussians
from ..splats.rasterizer import backend
from .frames import Frame, downsample, split_bands, stack_bands
from .full_resolution import dense_weights
from .splatted_scene import SplattedScene

UNTRAINED = (
    "{folder} has no recoloring field F_w: renderings take palette weights from their own colors.",
    "Train it: karf recoloring {folder} --set recoloring.iterations=1000",
)
MASK_SAMPLES, WEIGHT_SAMPLES = 3, 8  # quantile samples per ray, for classes and for palette weights


class Learned:
    """The finished stages of a project, in memory: the attributes of `Model`."""

    def __init__(self, project: Project, device: torch.device, settings: Settings | None) -> None:
        project.require("geometry")
        self.project, self.device = project, device
        self.settings = settings or settings_for(project, "render")
        self.scene = load_scene(project.verified(project.geometry_file), device)
        self.objects: list[str] = []
        self.palettes: tuple[Palette, ...] = ()
        self.segmentation: SegmentationField | None = None
        self.recoloring: RecoloringField | None = None
        self.splatted: SplattedScene | None = None
        n_features, space = self.scene.field.n_features, self.scene.field.space
        if project.finished("segmentation"):
            path = project.verified(project.segmentation_file)
            self.segmentation, self.objects = load_segmentation(path, n_features, device, space)
        if project.finished("recoloring"):
            assert self.segmentation is not None
            self.palettes = read_palettes(project.verified(project.palette_file), objects=self.objects)
            if project.has_output("recoloring", project.recoloring_file):
                path, bounds = project.verified(project.recoloring_file), self.segmentation.bounds
                assert isinstance(bounds, torch.Tensor)
                self.recoloring = load_recoloring(path, bounds, n_features, self.palettes, device)
        if project.finished("splats") and self.settings.render.source == "splats" and backend(device):
            gaussians = load_gaussians(project.verified(project.splats_file))
            learned = self.scene, self.segmentation, self.palettes
            fades = self.settings.render.unseen == "faded"
            self.splatted = SplattedScene(gaussians, *learned, lambda: self.capture.views, fades)
            limit_torch_threads()  # numba's kernels render splats

    @cached_property
    def capture(self) -> Capture:
        """Raises DataError if its file is damaged."""
        return read_capture(self.project)

    @cached_property
    def doubts(self) -> SurfaceUncertainty:
        """Raises DataError if the segmentation has none."""
        return SurfaceUncertainty.read(self.project.verified(self.project.uncertainty_file))

    @property
    def splats(self) -> Gaussians | None:
        """The scene as Gaussians; None if cameras are rendered from the field."""
        return None if self.splatted is None else self.splatted.gaussians

    @property
    def learned_colors(self) -> np.ndarray:
        """Palettes as learned, [K, M, 3] float32 sRGB; smaller palettes are padded with 0."""
        return stack_palettes(self.objects, {palette.name: palette.colors for palette in self.palettes})

    @cached_property
    def photo_side(self) -> float:
        """Median long side of the capture's photos, pixels."""
        return float(np.median([max(view.camera.width, view.camera.height) for view in self.capture.views]))

    def check_edit(self, edit: Edit) -> None:
        """Raise BadRequest before palettes are learned, and for an edit of other palettes."""
        if not self.palettes:
            raise BadRequest(
                f"{self.project.folder} has no finished recoloring stage.", "Run the recoloring stage first."
            )
        check_edit(edit, self.palettes)

    def check_frame(self, frame: Frame) -> None:
        """Raise BadRequest for a frame of another model."""
        if len(frame.probabilities) != len(self.objects):
            count = len(frame.probabilities)
            raise BadRequest(
                f"The frame is of {count} objects, the model of {len(self.objects)}.", "Render it by this model."
            )


def in_bands(render: Callable[[Camera], Frame], pinhole: Camera, supersampling: int) -> Frame:
    """Render a supersampled pinhole in bands of rows that fit in memory."""
    frames = [downsample(render(band), supersampling) for band in split_bands(pinhole, supersampling)]
    return frames[0] if len(frames) == 1 else stack_bands(frames)


def field_frame(learned: Learned, pinhole: Camera) -> Frame:
    """Render a pinhole with palette weights by F_w, where it is trained; its base is the rendering."""
    picture = learned.scene.render(pinhole, WEIGHT_SAMPLES if learned.palettes else MASK_SAMPLES)
    return frame_of(learned, picture, picture.color.cpu().numpy(), from_field=True)


def photo_frame(learned: Learned, training_image: TrainingImage, weights_from: str = "photo") -> Frame:
    """Render the view of a photo, with it as base.

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
    base: np.ndarray,  # [H, W, 3] sRGB in [0, 1]
    from_field: bool,
    *,
    gains: tuple[float, float, float] = UNIT_GAINS,
) -> Frame:
    """Add probabilities and palette weights to a picture with a surface cache.

    from_field: weights by F_w where it is trained, else by the colors of the base. gains: exposure of the base.
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


def _object_samples(learned: Learned, picture: Picture) -> ObjectSamples:
    assert learned.segmentation is not None
    return object_samples(learned.segmentation, learned.scene.field, _cache_of(picture))


def _cache_of(picture: Picture) -> SurfaceCache:
    if picture.cache is None:
        raise BadRequest("The picture has no surface samples.", "Render it by scene.render.")
    return picture.cache
