"""The learned state of a project: scene, heads, palettes and splats, read from its files."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import torch

from ..capture.capture import Capture
from ..compute.cores import limit_torch_threads
from ..compute.kernels import has_kernels
from ..errors import BadRequest
from ..fields.files import load_scene
from ..heads.fields import RecoloringField, SegmentationField
from ..heads.files import load_recoloring, load_segmentation
from ..palettes.compositing import stack_palettes
from ..palettes.palette import Edit, Palette, check_edit, read_palettes
from ..project import Project
from ..project.contents import read_capture, settings_for
from ..project.settings import Settings
from ..segmentation.surface_points import SurfaceUncertainty
from ..splats.files import load_gaussians
from ..splats.gaussians import Gaussians
from .frames import Frame
from .splatted_scene import SplattedScene

UNTRAINED = (
    "{folder} has no recoloring field F_w: renderings take palette weights from their own colors.",
    "Train it: karf recoloring {folder} --set recoloring.iterations=1000",
)


class Learned:
    """The finished stages of a project, in memory. Attributes are described at `Model`.

    Capture and doubts are read when first used, the rest at once.
    """

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
        if project.finished("splats") and self.settings.render.source == "splats" and has_kernels():
            gaussians = load_gaussians(project.verified(project.splats_file))
            learned = self.scene, self.segmentation, self.palettes
            fades = self.settings.render.unseen == "faded"
            self.splatted = SplattedScene(gaussians, *learned, lambda: self.capture.views, fades)
            limit_torch_threads()  # numba's kernels render splats

    @cached_property
    def capture(self) -> Capture:
        """The photos and cameras that the model was learned from. Raises DataError if their file is damaged."""
        return read_capture(self.project)

    @cached_property
    def doubts(self) -> SurfaceUncertainty:
        """Uncertainty of the labels on the surface. Raises DataError if the segmentation has none."""
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
