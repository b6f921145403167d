"""A learned model: the scene, its objects and their palettes, loaded from a project's folder and used without jobs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NoReturn

import numpy as np
import torch

from ..capture.camera import Camera, check_camera
from ..capture.capture import View
from ..capture.training_images import TrainingImage, load_target_image, load_views
from ..compute.runtime import find_device
from ..errors import BadRequest
from ..fields.rendering.rays import camera_rays
from ..io.arguments import check_arguments, check_array, check_choice, check_number
from ..io.color import to_bytes
from ..io.failures import translate_errors
from ..io.images import alpha_composite
from ..palettes.added import extended_palettes, split_weights_of_objects
from ..palettes.calibration import to_mean_exposure, to_photo_exposure
from ..palettes.compositing import delta_composite, paper_composite, stack_palettes
from ..palettes.edge_planes import apply_edges_to_planes
from ..palettes.edge_shape import EdgeShape, active_edges
from ..palettes.matching.painted import ObjectMatch, match_picture
from ..palettes.palette import Edit
from ..palettes.project_edit import ProjectEdit, edit_of
from ..project import Project
from ..project.settings import Settings
from ..splats.gaussians import Gaussians
from .field_rendering import Learned, field_frame, in_bands, photo_frame
from .frames import BAND_RAYS, Frame, one_line
from .full_resolution import FindMattes, PhotoView, denoise, dense_weights, estimate_noise, make_photo_view
from .matting.matte import dense_coverage, disputed_objects
from .matting.thin_parts import Marks, read_marks, undistort_marks
from .render_cache import RenderCache

MOST_SUPERSAMPLING = 64
BASES = {"delta": "photo", "paper": "render"}  # by compositing


def base_of(settings: Settings, base: str | None) -> str:
    """Return the base of captured views, `photo` or `render`: the given one, or the default of the compositing."""
    if base is not None:
        check_choice("base", base, tuple(BASES.values()))
    return base or BASES[settings.compositing]


class Model(Learned):
    """A learned project: its scene, objects and palettes.

    Four ways to a picture:

    - `recolor`: a captured photo with an edit, in one call.
    - `photo_view`: a captured photo for many edits, in its own pixels, with its file's bit depth and metadata.
    - `preview`: a captured view as a small `Frame` (masks, depth, palette weights) with the edges of the photo.
    - `render`: any camera as a `Frame`.

    `composite` applies an edit to a `Frame`; `render_recolored` is a fast `composite` of `render`. `render_view` and
    `render_field` show what the field has learned, with its own edges, for inspection and measurements.

    Palette weights of a captured view come from the photo's own colors, times the object's probability: they are sharp
    and include the highlights. Weights of any other camera come from the colors of the splats; without splats from F_w
    where it is trained, else from the colors of the rendering.

    Attributes:
        project: the project's folder and its files.
        settings: those that its stages were run with, and how it renders.
        capture: the photos and cameras that it was learned from.
        scene: the radiance field, frozen.
        objects: names of the K segmented objects; empty before segmentation.
        segmentation: F_s, or None before segmentation.
        palettes: of the objects, in their order; empty before palettes are learned.
        recoloring: F_w, or None where it is not trained (`recoloring.iterations` of 0).
        splatted: the scene as Gaussians; None if they are not learned, if the settings select the field, or without the
            package numba.

    Example:
        model = Model.load("garden_karf")
        edit = model.edit().becomes("pot", "#b5302c", "#3059b8")
        picture = model.recolor(model.capture.view("r_003"), edit)
    """

    @check_arguments
    def __init__(self, project: Project, device: torch.device | str = "cpu", settings: Settings | None = None) -> None:
        """Load the finished stages of a project, by default with its own settings. Raises as `load` does."""
        super().__init__(project, find_device(device) if isinstance(device, str) else device, settings)
        self._cache = RenderCache(project)

    @classmethod
    @check_arguments
    def load(cls, folder: Path | str, device: str | None = None) -> Model:
        """Load the model in a project's folder, on `cpu`, `cuda`, `cuda:<number>` or `mps`; None for CUDA if there is one.

        Raises BadRequest if nothing is learned there or there is no such device, DataError if it is not a project or a
        file is damaged.
        """
        return cls(Project(folder).snapshot(), find_device(device))

    def __repr__(self) -> str:
        return one_line("Model", f"{self.project.folder}: {', '.join(self.objects) or 'no objects yet'}")

    def __reduce__(self) -> NoReturn:
        raise TypeError("A Model cannot be pickled. Pickle its model.project.folder, and Model.load(folder) there.")

    @check_arguments
    @translate_errors()
    def render(self, camera: Camera, supersampling: int = 1, *, fades: bool | None = None) -> Frame:
        """Render the scene from any camera, from splats where they are learned; the base is the rendering itself.

        Palette weights are those of the splats' colors; without splats of F_w where it is trained, else of the
        rendering's colors. Not differentiable.

        Args:
            camera: in world units; its lens distortion is left out.
            supersampling: samples per pixel along each side, averaged; of depths the median is taken.
            fades: whether splats that no photo shows fade to gray; None for `settings.render.unseen`.

        Raises BadRequest if `supersampling` is out of range, DataError for an invalid camera, OutOfMemory if the device
        has too little memory.
        """
        check_number("supersampling", supersampling, 1, MOST_SUPERSAMPLING)
        pinhole = _checked_camera(camera).without_distortion()
        if self.splatted is None:
            return in_bands(lambda band: field_frame(self, band), pinhole, supersampling)
        frame = in_bands(partial(self.splatted.frame, fades=fades), pinhole, supersampling)
        return replace(frame, camera=pinhole, supersampling=supersampling, fades=fades)

    @check_arguments
    def render_recolored(self, camera: Camera, edit: Edit, *, fades: bool | None = None) -> np.ndarray:
        """Render the recolored scene from any camera: `composite` of `render`, in a fraction of the time with splats.

        Returns [H, W, 3] float32 sRGB in [0, 1]. Raises BadRequest if no palettes are learned or the edit is not of them,
        DataError for an invalid camera.
        """
        self.check_edit(edit)
        _checked_camera(camera)
        if self.splatted is None or edit.compositing != "delta":  # colors of Gaussians cannot show other edits
            return self.composite(self.render(camera, fades=fades), edit)
        return self.splatted.render_recolored(camera, edit, fades)

    @check_arguments
    def render_background(self, camera: Camera) -> np.ndarray:
        """Render the background of a camera's pinhole, [H, W, 3] float32 sRGB. Raises DataError for an invalid camera."""
        pinhole = _checked_camera(camera).without_distortion()
        if self.splatted is not None:
            return self.splatted.render_background(pinhole)
        with torch.no_grad():
            bands = camera_rays(pinhole, self.device).viewdirs.split(BAND_RAYS)
            colors = torch.cat([self.scene.background_color(band) for band in bands])
        return colors.cpu().numpy().reshape(pinhole.height, pinhole.width, 3)

    @check_arguments
    def recolored_splats(self, edit: Edit) -> Gaussians:
        """Bake an edit into the colors of the splats. The last result is kept. Edges are lengths, see `with_edges`.

        Raises BadRequest if no splats or no palettes are learned, or for an edit with the paper's compositing.
        """
        if self.splatted is None or not self.palettes:
            raise BadRequest(
                f"{self.project.folder} has no finished splats and recoloring stages.", "Run these stages first."
            )
        if edit.compositing != "delta":
            raise BadRequest("An edit that replaces colors cannot be baked into splats.", "Make it one that adds.")
        self.check_edit(edit)
        return self.splatted.recolored(edit)

    @check_arguments
    @translate_errors()
    def render_field(self, camera: Camera) -> Frame:
        """Render the field with the camera's lens distortion, without palette weights; the base is the rendering.

        The project caches the frame. Raises DataError for an invalid camera, OutOfMemory if the device has too little.
        """
        return self._cache.frame(_checked_camera(camera), self)

    @check_arguments
    def label_uncertainty(self, pinhole: Camera, frame: Frame) -> np.ndarray:
        """Return the uncertainty of each object's label in a frame, [K, H, W] float32 in [0, 1].

        pinhole: the camera of the frame. Only the frame's depth and opacity are used.

        Raises BadRequest for a frame of another size or model, DataError if the uncertainties are missing or damaged.
        """
        _checked_camera(pinhole)
        self.check_frame(frame)
        check_array("frame.depth", frame.depth, (pinhole.height, pinhole.width))
        origins, directions = pinhole.rays(pinhole.pixel_centers())
        doubts = self.doubts.at(origins + frame.depth.reshape(-1, 1) * directions)
        return np.ascontiguousarray(doubts.T).reshape(-1, *frame.depth.shape) * frame.opacity

    @check_arguments
    def working_camera(self, view: View) -> Camera:
        """Return the camera of a captured view at the working size, with its lens distortion."""
        return view.camera.reduced(self.settings.geometry.long_side)

    @check_arguments
    def training_image(self, view: View) -> TrainingImage:
        """Load the photo of a view at the working size. Raises DataError if it is missing or damaged."""
        return load_views([view], self.settings.geometry.long_side)[0]

    @check_arguments
    @translate_errors()
    def render_view(self, view: View, base: str | None = None) -> Frame:
        """Render a captured view as its pinhole sees it, at the working size (`settings.geometry.long_side`).

        base: `photo` or `render`; by default the photo, or the rendering with the paper's compositing.

        Raises BadRequest for another base, DataError if the photo is missing or damaged.
        """
        if base_of(self.settings, base) == "photo":
            return photo_frame(self, self.training_image(view))
        return self.render(self.working_camera(view))

    @check_arguments
    def preview(self, view: View, long_side: int | None = None) -> Frame:
        """Return a captured view as its pinhole sees it, at a size that is quick to recolor.

        Base, probabilities (coverages, by `settings.render.edges`) and palette weights have this size; the picture has
        the working size. long_side: pixels, at most the photo's; by default `settings.render.preview`.

        Raises BadRequest for a size below 1, DataError if the photo is missing or damaged.
        """
        if long_side is not None:
            check_number("long_side", long_side, 1)
        field = self.render_field(self.working_camera(view).without_distortion())
        training_image = load_views([view], long_side or self.settings.render.preview)[0]
        base = alpha_composite(training_image.color, training_image.alpha)
        photo, rendered = to_bytes(base), to_bytes(field.color * np.array(view.gains, np.float32))
        marks = undistort_marks(self._marks(view), view.camera)
        mattes = self._find_mattes()(photo, field.probabilities, rendered, marks)
        coverages = dense_coverage(mattes, base.shape[:2])
        weights = None
        if self.palettes:
            denoised = denoise(photo, estimate_noise(photo))
            own_colors = [matte.own_picture(denoised) for matte in mattes]
            weights = dense_weights(own_colors, self.palettes, coverages, view.gains)
        return Frame(field.picture, coverages, weights, base, disputed_objects(self.objects, mattes), gains=view.gains)

    @check_arguments
    def photo_view(self, view: View, size: str | int = "photo") -> PhotoView:
        """Prepare a captured view for recoloring in its photo's own pixels, any number of times.

        size: `photo`, or the long side in pixels of the reduced photo.

        Raises BadRequest for another size, DataError if the photo is missing, damaged or of another size than its camera.
        """
        _check_size(size, ("photo",))
        field = self.render_field(self.working_camera(view))
        return make_photo_view(view, size, field, self._marks(view), self._find_mattes(), self.objects, self.palettes)

    def _marks(self, view: View) -> Marks:
        return read_marks(self.project.check_inside(self.project.masks_folder), self.objects, view)

    def _find_mattes(self) -> FindMattes:
        return partial(self._cache.mattes, self.settings.render.edges, seed=self.settings.seed)

    @check_arguments
    def edit(self, path: Path | str | None = None) -> ProjectEdit:
        """Return an edit without changes, or read one from a file. Raises BadRequest before palettes are learned."""
        return edit_of(self.project, path)

    @check_arguments
    def recolor(self, view: View, edit: Edit, size: str | int = "photo") -> np.ndarray:
        """Recolor a captured view, [H, W, 3] float32 sRGB in [0, 1], in the orientation of its camera.

        size: `photo`: all pixels of the photo, with its lens distortion; a long side in pixels: the same, reduced;
            `learned`: as its pinhole sees it at the working size. With the paper's compositing always the rendering at
            the working size.

        Raises BadRequest if no palettes are learned, the edit is not of them, or there is no such size, DataError if the
        photo is missing or damaged.
        """
        _check_size(size, ("photo", "learned"))
        self.check_edit(edit)
        if base_of(self.settings, None) == "render":
            return self.composite(self.render_view(view), edit)
        if size == "learned":
            return self.composite(self.preview(view, self.settings.geometry.long_side), edit)
        finished = self.photo_view(view, size)
        return finished.over_white(finished.recolor(edit))

    @check_arguments
    def composite(self, frame: Frame, edit: Edit) -> np.ndarray:
        """Composite an edit into the base of a frame, [H, W, 3] float32 sRGB.

        Raises BadRequest before palettes are learned, for an edit of other palettes, for a frame of another model, and
        for one without palette weights.
        """
        self.check_edit(edit)
        frame = self.with_edges(frame, edit.edges)
        assert frame.palette_weights is not None
        edited = to_photo_exposure(stack_palettes(self.objects, edit.colors), frame.gains)
        weights = split_weights_of_objects(frame.palette_weights, self.palettes, edit.added)
        if edit.compositing == "paper":
            return paper_composite(frame.base, weights, frame.probabilities, edited)
        known = {each.name: each.colors for each in extended_palettes(self.palettes, edit.added)}
        before = to_photo_exposure(stack_palettes(self.objects, known), frame.gains)
        return delta_composite(frame.base, weights, before, edited)

    @check_arguments
    def with_edges(self, frame: Frame, edges: Mapping[str, EdgeShape]) -> Frame:
        """Move and fade the edges of objects in a frame with palette weights; without changes, return the frame itself.

        edges: by object, in pixels of the capture's photos. A smaller frame scales them; in a frame that `render` made
            from splats they are lengths, the size of such a pixel at the object.

        Raises BadRequest for a frame of another model or without palette weights, and for edges of other objects.
        """
        self.check_frame(frame)
        if frame.palette_weights is None:
            raise BadRequest("The frame has no palette weights.", "Take one of render, render_view or preview.")
        if not set(edges) <= set(self.objects):
            raise BadRequest(f"The edges are of {', '.join(edges):.200}.", f"Objects are: {', '.join(self.objects)}.")
        if not active_edges(edges):
            return frame
        if frame.camera is not None and self.splatted is not None:
            render = partial(self.splatted.frame, edges=active_edges(edges), fades=frame.fades)
            shaped = in_bands(render, frame.camera, frame.supersampling)
            return replace(frame, palette_weights=shaped.palette_weights, probabilities=shaped.probabilities)
        scale = max(frame.base.shape[:2]) / self.photo_side
        planes = to_mean_exposure(frame.base, frame.gains), frame.palette_weights, frame.probabilities
        weights, probabilities = apply_edges_to_planes(*planes, self.palettes, edges, scale)
        return replace(frame, palette_weights=weights, probabilities=probabilities)

    @check_arguments
    def match(self, view: View, picture: Path | str, edit: Edit) -> tuple[ObjectMatch, ...]:
        """Find the palettes that bring a captured view closest to a painted or graded picture of it.

        picture: of the photo's size and with its lens distortion, or of any other size without distortion. edit: the
            current palettes, which the picture may be based on; its added colors stay.

        Returns a match for each object that changes. Raises BadRequest if the picture has another shape than the view,
        DataError if picture or photo is missing or damaged.
        """
        self.check_edit(edit)
        frame = self.preview(view)
        assert frame.palette_weights is not None
        wanted = load_target_image(view, Path(picture), self.settings.render.preview)
        weights = split_weights_of_objects(frame.palette_weights, self.palettes, edit.added)
        palettes = extended_palettes(self.palettes, edit.added)
        sets = {each.name: range(len(each.colors), len(edit.colors[each.name])) for each in self.palettes}
        before, after = (to_mean_exposure(each, view.gains) for each in (frame.base, wanted))
        return match_picture(weights, frame.probabilities, before, after, palettes, edit.colors, sets)


def _checked_camera(camera: Camera) -> Camera:
    check_camera(camera, "The camera", "Correct it.")
    return camera


def _check_size(size: str | int, names: tuple[str, ...]) -> None:
    if isinstance(size, str):
        check_choice("size", size, names)
    else:
        check_number("size", size, 1)
