"""A learned model: the scene, its objects and their palettes, loaded from a project's folder and used without jobs.

Where do the palette weights come from? In a captured view from the photo's own colors times the object's probability:
they are sharp and hold the highlights. For any other camera from the colors of the splats, which are the same from
everywhere, or where none are learned from F_w: that is what view-consistent means.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import ALIKE, Capture, View
from ..capture.distortion import straighten
from ..capture.limits import check_camera
from ..capture.training_images import TrainingImage, load_views, load_wanted
from ..compute.cores import take_from_torch
from ..compute.kernels import has_kernels
from ..compute.runtime import find_device
from ..errors import BadRequest
from ..fields.files import load_scene
from ..fields.rendering.rays import camera_rays
from ..fields.scene import Picture
from ..heads.fields import RecoloringField, SegmentationField
from ..heads.files import load_recoloring, load_segmentation
from ..heads.rendering import ObjectSamples, object_samples, segment_cache, weigh_cache
from ..io.arguments import check_array, check_choice, check_number, checked
from ..io.color import to_bytes
from ..io.failures import translated
from ..io.images import over
from ..palettes.added import palettes_with, spread_objects
from ..palettes.compositing import delta_composite, paper_composite, stack_palettes
from ..palettes.edge_planes import reshaped
from ..palettes.edge_shape import EdgeShape, shaped_edges
from ..palettes.exposure import as_exposed, exposed_alike
from ..palettes.matching.painted import ObjectMatch, match_picture
from ..palettes.palette import Edit, Palette, check_edit, read_palettes
from ..palettes.project_edit import ProjectEdit, edit_of
from ..project import Project
from ..project.contents import capture_of, settings_for
from ..project.locking import consistent, opened
from ..project.settings import Settings
from ..segmentation.doubts import SurfaceDoubts
from ..splats.files import load_gaussians
from ..splats.gaussians import Gaussians
from .frames import BAND_RAYS, Frame, averaged, bands_of, joined
from .full_resolution import PhotoView, dense_weights, full_resolution_view
from .grain import grain_of, without_grain
from .matting.marks import Marks, marks_of, straightened
from .matting.matte import Matte, dense_coverage, disputed_objects
from .render_cache import RenderCache
from .splatted_scene import SplattedScene

BASES = {"delta": "photo", "paper": "render"}  # default picture that an edit of a captured view changes
MOST_SUPERSAMPLING = 64
MASK_SAMPLES, WEIGHT_SAMPLES = 3, 8  # quantile samples a ray: colors need more of them than classes


class Model:
    """All that is learned of a project.

    Attributes:
        project: the project's folder and its files.
        settings: those that its stages were run with, and how it renders.
        capture: the photos and cameras that it was learned from.
        scene: the radiance field, frozen.
        objects: names of the segmented objects, K of them; empty before segmentation.
        segmentation: F_s, or None before segmentation.
        palettes: of the objects, in their order; empty before palettes are learned.
        recoloring: F_w, or None before palettes are learned.
        splatted: the scene as Gaussians, from which any camera is rendered; None where they are not learned, the settings
            ask for the field, or the package numba is missing.

    Example:
        model = Model.load("garden_karf")
        edit = model.edit().becomes("pot", "#b5302c", "#3059b8")
        picture = model.recolor(model.capture.view("r_003"), edit)
    """

    @checked
    def __init__(self, project: Project, device: torch.device | str = "cpu", settings: Settings | None = None) -> None:
        """Load what is finished of a project, by default with its own settings.

        Raises BadRequest where nothing is finished or there is no such device, DataError where a file is damaged.
        """
        project.require("geometry")
        self.project, self.device = project, find_device(device) if isinstance(device, str) else device
        self.settings = settings or settings_for(project, "render")
        self.scene = load_scene(project.checked(project.geometry_file), self.device)
        self.objects: list[str] = []
        self.palettes: tuple[Palette, ...] = ()
        self.segmentation: SegmentationField | None = None
        self.recoloring: RecoloringField | None = None
        n_features, space = self.scene.field.n_features, self.scene.field.space
        if project.finished("segmentation"):
            path = project.checked(project.segmentation_file)
            self.segmentation, self.objects = load_segmentation(path, n_features, self.device, space)
        if project.finished("recoloring"):
            self.palettes = read_palettes(project.checked(project.palette_file), objects=self.objects)
            path, bounds = project.checked(project.recoloring_file), self.segmentation.bounds
            self.recoloring = load_recoloring(path, bounds, n_features, self.palettes, self.device)
        self.splatted: SplattedScene | None = None
        if project.finished("splats") and self.settings.render.source == "splats" and has_kernels():
            gaussians = load_gaussians(project.checked(project.splats_file))
            learned = self.scene, self.segmentation, self.palettes
            fades = self.settings.render.unseen == "faded"
            self.splatted = SplattedScene(gaussians, *learned, lambda: self.capture.views, fades)
            take_from_torch()  # pictures of splats are made by kernels, whatever the field is computed by
        self._looks = RenderCache(project)
        self._looked: tuple[Any, Frame | None] = (None, None)

    @classmethod
    @checked
    def load(cls, folder: Path | str, device: str | None = None) -> Model:
        """What is learned in a project's folder.

        Args:
            folder: the project.
            device: `cpu`, `cuda` or `cuda:<number>`; None for CUDA where there is one.

        Raises:
            BadRequest: nothing is learned there, or there is no such device.
            DataError: it is not a project, or a file is damaged.
        """
        project = opened(folder)
        project.require("geometry")  # before a lock is made: no folder is, and no other one is touched
        with consistent(project):
            return cls(project, find_device(device))

    @cached_property
    def capture(self) -> Capture:
        """The photos and cameras that the model was learned from. Raises DataError where their file is damaged."""
        return capture_of(self.project)

    def __repr__(self) -> str:
        return f"Model({self.project.folder}: {', '.join(self.objects) or 'no objects yet'})"

    @property
    def splats(self) -> Gaussians | None:
        """The scene as Gaussians, from which any camera is rendered; None where it is rendered from the field."""
        return None if self.splatted is None else self.splatted.gaussians

    @property
    def learned_colors(self) -> np.ndarray:
        """Palettes as learned, [K, M, 3] float32 sRGB; missing entries of smaller palettes are 0."""
        return stack_palettes(self.objects, {palette.name: palette.colors for palette in self.palettes})

    # --- rendering -------------------------------------------------------------------------------------------------
    @checked
    @translated()
    def render(self, camera: Camera, supersampling: int = 1, *, fades: bool | None = None) -> Frame:
        """The scene from any camera, whose lens distortion is left out, as splats where they are learned.

        Palette weights are then those of the splats' colors, else of F_w. Not differentiable. Its base is the rendering
        itself. No surface cache is kept of splats and of large pictures.

        Args:
            camera: in world units.
            supersampling: rays (or pixels of splats) a pixel along each side; their colors, opacities, probabilities and weights are
                averaged, of their depths the median counts.
            fades: whether what no photo shows fades into gray, of splats; by default as `settings.render.unseen` says.

        Raises:
            BadRequest: `supersampling` is out of range.
            DataError: the camera cannot be, see `capture.limits.check_camera`.
            OutOfMemory: the device has too little.
        """
        check_number("supersampling", supersampling, 1, MOST_SUPERSAMPLING)
        check_camera(camera, "The camera", "Correct it.")
        camera = camera.without_distortion()
        if self.splats is None:
            return _in_bands(self._render_pinhole, camera, supersampling)
        frame = _in_bands(partial(self.splatted.frame, fades=fades), camera, supersampling)
        return replace(frame, camera=camera, supersampling=supersampling, fades=fades)

    def _render_pinhole(self, camera: Camera) -> Frame:
        from_field = self.recoloring is not None
        picture = self.scene.render(camera, WEIGHT_SAMPLES if from_field else MASK_SAMPLES)
        return self.frame_of(picture, picture.color.cpu().numpy(), from_field)

    @checked
    def shown(self, camera: Camera, edit: Edit, *, fades: bool | None = None) -> np.ndarray:
        """The recolored scene from any camera, as `composite` of `render` has it, in a fraction of the time with splats.

        Args:
            camera: in world units; its lens distortion is left out.
            edit: of this model's palettes.
            fades: as of `render`.

        Returns:
            [H, W, 3] float32 sRGB in [0, 1].

        Raises:
            BadRequest: no palettes are learned, or the edit is not of them.
            DataError: the camera cannot be.
        """
        self._check_edit(edit)
        check_camera(camera, "The camera", "Correct it.")
        if self.splats is None or edit.compositing != "delta":  # which no change of Gaussians can show
            return self.composite(self.render(camera, fades=fades), edit)
        return self.splatted.shown(camera, edit, fades)

    @checked
    def recolored_splats(self, edit: Edit) -> Gaussians:
        """The splats with an edit baked into their colors; the last one is kept. Edges are lengths, see `with_edges`.

        Raises:
            BadRequest: No splats or no palettes are learned, or the edit composites as the paper does, which no change of
                single colors can show.
        """
        if self.splats is None or self.recoloring is None:
            raise BadRequest(
                f"{self.project.folder} has no finished splats and recoloring stages.", "Run these stages first."
            )
        if edit.compositing != "delta":
            raise BadRequest("An edit that replaces colors cannot be baked into splats.", "Make it one that adds.")
        self._check_edit(edit)
        return self.splatted.recolored(edit)

    @checked
    @torch.no_grad()
    def behind(self, camera: Camera) -> np.ndarray:
        """What a camera's pinhole sees behind all that is solid, [H, W, 3] float32 sRGB. Raises DataError where the camera cannot be."""
        check_camera(camera, "The camera", "Correct it.")
        if self.splats is not None:
            return self.splatted.behind(camera.without_distortion())
        rays = camera_rays(camera.without_distortion(), self.device)
        colors = [self.scene.behind(some) for some in rays.viewdirs.split(BAND_RAYS)]
        return torch.cat(colors).cpu().numpy().reshape(camera.height, camera.width, 3)

    @checked
    def render_view(self, view: View, base: str | None = None) -> Frame:
        """A captured view as its pinhole shows it, at the working size (`settings.geometry.long_side`).

        Objects end where the field ends them; see `preview` and `photo_view` for the edges of the photo.

        Args:
            view: of the capture.
            base: `photo` or `render`; by default the photo, or with the paper's compositing the rendering, as there.

        Raises:
            BadRequest: there is no such base.
            DataError: the photo is missing or damaged.
        """
        if self.base_of(base) == "photo":
            return self.render_training_image(self.training_image(view))
        return self.render(self.working_camera(view))

    @checked
    def base_of(self, base: str | None) -> str:
        """What an edit of a captured view changes, `photo` or `render`, where `base` was asked for. Raises BadRequest for others."""
        if base is not None:
            check_choice("base", base, tuple(BASES.values()))
        return base or BASES[self.settings.compositing]

    @checked
    def working_camera(self, view: View) -> Camera:
        """The camera of a captured view at the working size, with its lens."""
        return view.camera.reduced(self.settings.geometry.long_side)

    @checked
    @translated()
    def look(self, camera: Camera) -> Frame:
        """What the field alone renders, in the grid of a camera with its lens: no palette weights, itself as base.

        It is kept in the project, and the last one in memory. Raises DataError where the camera cannot be, OutOfMemory
        where the device has too little.
        """
        check_camera(camera, "The camera", "Correct it.")
        known, frame = self._looked
        if known != camera:
            frame = self._looks.find(camera, len(self.objects), self.device)
            if frame is None:
                frame = self._look(camera)
                self._looks.keep(camera, frame)
            self._looked = camera, frame
        return frame

    def _look(self, camera: Camera) -> Frame:
        picture = self.scene.render(camera, MASK_SAMPLES)
        frame = Frame(picture, self._probabilities(picture), None, picture.color.cpu().numpy())
        if not camera.is_pinhole:  # where a lens shows nothing, the rays are those of another pixel
            beyond = np.isnan(straighten(camera, camera.pixel_centers())).any(1).reshape(frame.depth.shape)
            frame.probabilities[:, beyond] = 0
        return frame

    @checked
    def unsure(self, pinhole: Camera, frame: Frame) -> np.ndarray:
        """How unsure it is what a frame shows of each object, [K, H, W] float32 in [0, 1].

        Args:
            pinhole: whose frame it is.
            frame: only its depth and opacity count.

        Raises:
            BadRequest: the frame has another size, or is of another model.
            DataError: the segmentation kept no doubts, or they are damaged.
        """
        check_camera(pinhole, "The camera", "Correct it.")
        self._check_frame(frame)
        check_array("frame.depth", frame.depth, (pinhole.height, pinhole.width))
        origins, directions = pinhole.rays(pinhole.pixel_centers())
        doubts = self._doubts.at(origins + frame.depth.reshape(-1, 1) * directions)
        return np.ascontiguousarray(doubts.T).reshape(-1, *frame.depth.shape) * frame.opacity

    @cached_property
    def _doubts(self) -> SurfaceDoubts:
        return SurfaceDoubts.read(self.project.checked(self.project.doubts_file))

    @checked
    def preview(self, view: View, long_side: int | None = None) -> Frame:
        """A captured view as its pinhole shows it, at a size to look at and to recolor quickly.

        Base, probabilities (coverages, by `settings.render.edges`) and palette weights are of this size; the
        picture is of the working size.

        Args:
            view: of the capture.
            long_side: pixels, at most the photo's; by default `settings.render.preview`.

        Raises:
            BadRequest: the size is below 1.
            DataError: the photo is missing or damaged.
        """
        if long_side is not None:
            check_number("long_side", long_side, 1)
        training_image = load_views([view], long_side or self.settings.render.preview)[0]
        seen, base = (
            self.look(self.working_camera(view).without_distortion()),
            over(training_image.color, training_image.alpha),
        )
        rendered = to_bytes(seen.color * np.float32(view.gains))
        marks = straightened(
            marks_of(self.project.contained(self.project.masks_folder), self.objects, view), view.camera
        )
        mattes = self._mattes_of(to_bytes(base), seen.probabilities, rendered, marks)
        coverages = dense_coverage(mattes, base.shape[:2])
        weights = None
        if self.recoloring is not None:
            photo = to_bytes(base)
            calm = without_grain(photo, grain_of(photo))
            own_colors = [matte.own_picture(calm) for matte in mattes]
            weights = dense_weights(own_colors, self.palettes, coverages, view.gains)
        disputed = disputed_objects(self.objects, mattes)
        return Frame(seen.picture, coverages, weights, base, disputed, gains=view.gains)

    @checked
    def photo_view(self, view: View, size: str | int = "photo") -> PhotoView:
        """A captured view in its photo's own pixels, to be recolored any number of times.

        Args:
            view: of the capture.
            size: `photo`, or a long side in pixels to which the photo is reduced.

        Raises:
            BadRequest: the size is neither `photo` nor a number from 1.
            DataError: the photo is missing, damaged or of another size than its camera.
        """
        _check_size(size, ("photo",))
        seen = self.look(self.working_camera(view))
        marks = marks_of(self.project.contained(self.project.masks_folder), self.objects, view)
        return full_resolution_view(view, size, seen, marks, self._mattes_of, self.objects, self.palettes)

    def _mattes_of(
        self, photo: np.ndarray, probabilities: np.ndarray, rendered: np.ndarray, marks: Marks
    ) -> list[Matte]:
        edges, seed = self.settings.render.edges, self.settings.seed
        return self._looks.mattes(edges, photo, probabilities, rendered, marks, seed)

    @checked
    @translated()
    def render_training_image(self, training_image: TrainingImage, weights_from: str = "photo") -> Frame:
        """A loaded photo's view, with the photo as base. weights_from: palette weights of its colors (`photo`), or of
        F_w (`field`). Raises BadRequest for others."""
        check_choice("weights_from", weights_from, ("photo", "field"))
        from_field = self.recoloring is not None and weights_from == "field"
        picture = self.scene.render(training_image.camera, WEIGHT_SAMPLES if from_field else MASK_SAMPLES)
        base = over(training_image.color, training_image.alpha)  # on the same ground as a rendering
        return self.frame_of(picture, base, from_field, gains=training_image.view.gains)

    @checked
    def frame_of(
        self, picture: Picture, base: np.ndarray, from_field: bool, *, gains: tuple[float, float, float] = ALIKE
    ) -> Frame:
        """The frame of a picture that this scene has rendered: what F_s and the palettes add to it.

        from_field: palette weights of F_w, else of the colors of the base [H, W, 3], which has the picture's size.
        gains: how the base is exposed, see `View`.
        Raises BadRequest for a base of another size, and for a picture whose surface samples were not kept.
        """
        _check_cache(picture)
        check_array("base", base, (*picture.opacity.shape, 3))
        samples = None
        if self.recoloring is not None and from_field:
            samples = object_samples(self.segmentation, self.scene.field, picture.cache)
        probabilities = self._probabilities(picture, samples)
        weights = None
        if self.recoloring is not None:
            known = samples is not None
            weights = (
                self.weights_of_field(picture, samples)
                if known
                else self.weights_of_colors(base, probabilities, gains=gains)
            )
        return Frame(picture, probabilities, weights, base, gains=gains)

    @checked
    def training_image(self, view: View) -> TrainingImage:
        """The photo of a view at the working size. Raises DataError where it is missing or damaged."""
        return load_views([view], self.settings.geometry.long_side)[0]

    def _probabilities(self, picture: Picture, samples: ObjectSamples | None = None) -> np.ndarray:
        height, width = picture.opacity.shape
        result = np.zeros((len(self.objects), height * width), np.float32)
        if self.segmentation is not None:
            known = samples is not None
            classes = samples.rendered if known else segment_cache(self.segmentation, self.scene.field, picture.cache)
            result[:, picture.cache.index.cpu().numpy()] = classes[:, 1:].T.cpu().numpy()
        return result.reshape(-1, height, width)

    @checked
    def weights_of_colors(
        self, base: np.ndarray, probabilities: np.ndarray, *, gains: tuple[float, float, float] = ALIKE
    ) -> np.ndarray:
        """Palette weights [K, M, H, W] of the colors of a picture [H, W, 3], exposed by these gains (`View`), and
        probabilities [K, H, W]. Raises BadRequest for other shapes, and for numbers that are not finite."""
        check_array("base", base, ("H", "W", 3))
        if not (np.isfinite(base).all() and np.isfinite(probabilities).all()):
            raise BadRequest("base or probabilities are not finite.", "Give numbers from 0 to 1.")
        check_array("probabilities", probabilities, (len(self.objects), *base.shape[:2]))
        return dense_weights([to_bytes(base)] * len(self.objects), self.palettes, probabilities, gains)

    @checked
    def weights_of_field(self, picture: Picture, samples: ObjectSamples | None = None) -> np.ndarray:
        """Palette weights [K, M, H, W] of F_w (Eq. 9 on top of Eq. 8). samples: the picture's, where they are known.
        Raises BadRequest for a picture whose surface samples were not kept."""
        _check_cache(picture)
        height, width = picture.opacity.shape
        cache = picture.cache
        samples = object_samples(self.segmentation, self.scene.field, cache) if samples is None else samples
        planes = weigh_cache(self.recoloring, samples, cache)
        weights = np.zeros((*planes.shape[1:], height * width), np.float32)
        weights[..., cache.index.cpu().numpy()] = planes.permute(1, 2, 0).cpu().numpy()
        return weights.reshape(*planes.shape[1:], height, width)

    # --- editing ---------------------------------------------------------------------------------------------------
    @checked
    def edit(self, path: Path | str | None = None) -> ProjectEdit:
        """An edit that changes nothing yet, or that of a file. Raises BadRequest before palettes are learned."""
        return edit_of(self.project, path)

    @checked
    def match(self, view: View, picture: Path | str, edit: Edit) -> tuple[ObjectMatch, ...]:
        """The palettes with which a captured view comes closest to a painted or graded picture of it.

        Args:
            view: of the capture.
            picture: as large as the photo, then with its lens; or of any other size, then without lens distortion.
            edit: the palettes as they stand, on which the picture may have been painted; its added colors stay.

        Returns:
            one for each object that the picture wants otherwise.

        Raises:
            BadRequest: the picture has another shape than the view.
            DataError: picture or photo is missing or damaged.
        """
        self._check_edit(edit)
        wanted = load_wanted(view, Path(picture), self.settings.render.preview)
        frame = self.preview(view)
        weights = spread_objects(frame.palette_weights, self.palettes, edit.added)
        palettes = palettes_with(self.palettes, edit.added)
        sets = {each.name: range(len(each.colors), len(edit.colors[each.name])) for each in self.palettes}
        before, wanted = (exposed_alike(each, view.gains) for each in (frame.base, wanted))
        return match_picture(weights, frame.probabilities, before, wanted, palettes, edit.colors, sets)

    @checked
    def recolor(self, view: View, edit: Edit, size: str | int = "photo") -> np.ndarray:
        """A captured view with an edit.

        Args:
            view: of the capture.
            edit: of this model's palettes.
            size: `photo`: all pixels of the photo, with its lens; a long side in pixels: the same, reduced; `learned`:
                as its pinhole shows it at the working size, as the rendering, which always is the base with the
                paper's compositing.

        Returns:
            [H, W, 3] float32 sRGB in [0, 1], as its camera is turned. `photo_view` writes what the photo's file held.

        Raises:
            BadRequest: no palettes are learned, the edit is not of them, or there is no such size.
            DataError: the photo is missing or damaged.
        """
        _check_size(size, ("photo", "learned"))
        self._check_edit(edit)
        if self.base_of(None) == "render":
            return self.composite(self.render_view(view), edit)
        if size == "learned":
            return self.composite(self.preview(view, self.settings.geometry.long_side), edit)
        finished = self.photo_view(view, size)
        return finished.shown(finished.recolored(edit))

    @checked
    def composite(self, frame: Frame, edit: Edit) -> np.ndarray:
        """The base of a frame with an edit, [H, W, 3] float32 sRGB. Raises BadRequest before palettes are learned, for an
        edit that is not of them, and for a frame of another model or without palette weights, as those of `look`."""
        self._check_edit(edit)
        frame = self.with_edges(frame, edit.edges)
        edited = as_exposed(stack_palettes(self.objects, edit.colors), frame.gains)
        weights = spread_objects(frame.palette_weights, self.palettes, edit.added)
        if edit.compositing == "paper":
            return paper_composite(frame.base, weights, frame.probabilities, edited)
        known = {each.name: each.colors for each in palettes_with(self.palettes, edit.added)}
        learned = as_exposed(stack_palettes(self.objects, known), frame.gains)
        return delta_composite(frame.base, weights, learned, edited)

    @checked
    def with_edges(self, frame: Frame, edges: Mapping[str, EdgeShape]) -> Frame:
        """A frame with palette weights, whose objects end as an edit wants; without edges that change, the frame itself.

        edges: by object, in pixels of the capture's photos. A frame whose long side is shorter than theirs scales them; of
            splats, as `render` makes them, they are lengths: what such a pixel spans at the object.

        Raises BadRequest for a frame of another model or without palette weights, and for edges of other objects.
        """
        self._check_frame(frame)
        if frame.palette_weights is None:
            raise BadRequest("The frame has no palette weights.", "Take one of render, render_view or preview.")
        if not set(edges) <= set(self.objects):
            raise BadRequest(f"The edges are of {', '.join(edges):.200}.", f"Objects are: {', '.join(self.objects)}.")
        if not shaped_edges(edges):
            return frame
        if frame.camera is not None and self.splats is not None:
            render = partial(self.splatted.frame, edges=shaped_edges(edges), fades=frame.fades)
            ended = _in_bands(render, frame.camera, frame.supersampling)
            return replace(frame, palette_weights=ended.palette_weights, probabilities=ended.probabilities)
        scale = max(frame.base.shape[:2]) / self._photo_side
        shown = exposed_alike(frame.base, frame.gains), frame.palette_weights, frame.probabilities
        weights, probabilities = reshaped(*shown, self.palettes, edges, scale)
        return replace(frame, palette_weights=weights, probabilities=probabilities)

    @cached_property
    def _photo_side(self) -> float:
        """The long side of the capture's photos, pixels: the median."""
        return float(np.median([max(view.camera.width, view.camera.height) for view in self.capture.views]))

    def _check_frame(self, frame: Frame) -> None:
        if len(frame.probabilities) != len(self.objects):
            count = len(frame.probabilities)
            raise BadRequest(
                f"The frame is of {count} objects, the model of {len(self.objects)}.", "Render it by this model."
            )

    def _check_edit(self, edit: Edit) -> None:
        if self.recoloring is None:
            raise BadRequest(
                f"{self.project.folder} has no finished recoloring stage.", "Run the recoloring stage first."
            )
        check_edit(edit, self.palettes)


def _check_cache(picture: Picture) -> None:
    if picture.cache is None:
        raise BadRequest("The picture has no surface samples.", "Render it by scene.render.")


def _check_size(size: str | int, names: tuple[str, ...]) -> None:
    if isinstance(size, str):
        check_choice("size", size, names)
    else:
        check_number("size", size, 1)


def _in_bands(render: Callable[[Camera], Frame], pinhole: Camera, supersampling: int) -> Frame:
    """A pinhole's frame, of several rays a pixel, rendered in bands of rows that memory holds."""
    frames = [averaged(render(band), supersampling) for band in bands_of(pinhole, supersampling)]
    return frames[0] if len(frames) == 1 else joined(frames)
