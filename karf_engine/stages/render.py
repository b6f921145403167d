"""Rendering: masks, pictures, recolored frames and edit planes of captured views or of any cameras.

Options: views (train | test | val | all | name,name | CAMERAS.json), edit (EDIT.json, or a list with one for each view,
in their order), out (folder), base (photo | render, for captured views; by default the photo, with the paper's
compositing the render, as there), planes, depth (bools). Writes

    OUT/render/<view>.png            the scene as learned
    OUT/masks/<object>/<view>.png    0 or 255
    OUT/recolor/<view>.png           the edited base picture
    OUT/depth/<view>.npy             float32 along the optical axis, world units, 0 where empty
    OUT/planes/<view>.npz            edit planes; of captured views also in the project, where Blender finds them

Where do the palette weights come from? In a captured view from the photo's own colors times the object's probability:
they are sharp and hold the highlights. For any other camera from F_w, which is what view-consistent means.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..capture import open_capture
from ..capture.capture import View
from ..color import to_bytes
from ..edit.compositing import Planes, delta_composite, paper_composite, stack_palettes, write_planes
from ..edit.palette import Edit, Palette, read_edit
from ..errors import BadRequest, DataError
from ..fields.files import load_scene
from ..fields.scene import Picture
from ..files import atomic_write
from ..heads.fields import RecoloringField, SegmentationField
from ..heads.files import load_recoloring, load_segmentation
from ..heads.rendering import ObjectSamples, object_samples, segment_cache, weigh_cache
from ..images import write_png
from ..locking import consistent, opened, writing
from ..palette.star_weights import palette_weights_of_image
from ..plates import Plate
from ..progress import Emit
from ..wire import Request
from .job import Job, open_job
from .recoloring import palettes_of

BASES = {"delta": "photo", "paper": "render"}  # what an edit of a captured view changes, where nothing is said
MASK_SAMPLES, WEIGHT_SAMPLES = 3, 8  # quantile samples a ray: colors need more of them than classes


@dataclass(frozen=True)
class Frame:
    """One rendered view. picture: the scene as learned. probabilities: [K, H, W]. palette_weights: [K, M, H, W] or None
    before the recoloring stage. base: float32 [H, W, 3] that an edit changes."""

    picture: Picture
    probabilities: np.ndarray
    palette_weights: np.ndarray | None
    base: np.ndarray

    @property
    def masks(self) -> np.ndarray:
        """The likeliest class of each pixel as masks, [K, H, W] bool (argmax of Eq. 8)."""
        background = 1 - self.probabilities.sum(0)
        return (self.probabilities > background) & (self.probabilities == self.probabilities.max(0, initial=0))


class Renderer:
    """All that is learned of a project, loaded once."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self.scene = load_scene(job.project.checked(job.project.geometry_file), job.runtime.device)
        self.objects: list[str] = []
        self.palettes: tuple[Palette, ...] = ()
        self.segmentation: SegmentationField | None = None
        self.recoloring: RecoloringField | None = None
        if job.project.finished("segmentation"):
            path = job.project.checked(job.project.segmentation_file)
            self.segmentation, self.objects = load_segmentation(path, self.scene.field.n_features, job.runtime.device)
        if job.project.finished("recoloring"):
            self.palettes = tuple(palettes_of(job, self.objects))
            bounds, n_features = self.segmentation.bounds, self.scene.field.n_features
            path = job.project.checked(job.project.recoloring_file)
            self.recoloring = load_recoloring(path, bounds, n_features, self.palettes, job.runtime.device)

    @property
    def learned(self) -> np.ndarray:
        """Palettes as learned, [K, M, 3]."""
        return stack_palettes(self.objects, {palette.name: palette.colors for palette in self.palettes})

    def frame(self, view: View, plate: Plate | None, weights_from: str) -> Frame:
        """Render a view. plate: its photo, which becomes the base, or None. weights_from: `photo` or `field`."""
        camera = view.camera if plate is None else plate.camera
        from_field = self.recoloring is not None and (plate is None or weights_from == "field")
        n_samples = WEIGHT_SAMPLES if from_field else MASK_SAMPLES
        picture = self.scene.render(camera.without_distortion(), n_samples)
        base = picture.color.cpu().numpy() if plate is None else self._photo_base(plate)
        return self.dressed(picture, base, from_field)

    def dressed(self, picture: Picture, base: np.ndarray, from_field: bool) -> Frame:
        """The frame of a picture that this scene rendered: what the two fields on top say of it.

        from_field: palette weights from F_w, else from the colors of the base [H, W, 3].
        """
        probabilities = self._probabilities(picture)
        weights = None
        if self.recoloring is not None:
            weights = self.weights_of_field(picture) if from_field else self.weights_of_colors(base, probabilities)
        return Frame(picture, probabilities, weights, base)

    def _photo_base(self, plate: Plate) -> np.ndarray:
        if plate.alpha is None:
            return plate.color
        # a matte capture is shown on the same ground as its rendering
        return plate.color * plate.alpha[..., None] + (1 - plate.alpha[..., None])

    def _probabilities(self, picture: Picture) -> np.ndarray:
        height, width = picture.opacity.shape
        result = np.zeros((len(self.objects), height * width), np.float32)
        if self.segmentation is not None:
            classes = segment_cache(self.segmentation, self.scene.field, picture.cache)
            result[:, picture.cache.index.cpu().numpy()] = classes[:, 1:].T.cpu().numpy()
        return result.reshape(-1, height, width)

    def weights_of_colors(self, base: np.ndarray, probabilities: np.ndarray) -> np.ndarray:
        """Planes [K, M, H, W] from the colors of a base picture [H, W, 3] and probabilities [K, H, W]."""
        n_colors = self.learned.shape[1]
        weights = np.zeros((len(self.objects), n_colors, *base.shape[:2]), np.float32)
        pixels = to_bytes(base)
        for k, palette in enumerate(self.palettes):
            inside = probabilities[k] > 1 / 512  # less cannot change an 8-bit pixel
            own = palette_weights_of_image(pixels[inside][None], palette.colors)[0]
            weights[k, : len(palette.colors), inside] = own * probabilities[k][inside, None]
        return weights

    def weights_of_field(self, picture: Picture, samples: ObjectSamples | None = None) -> np.ndarray:
        """Planes [K, M, H, W] of paper Eq. 9 on top of Eq. 8, from F_w. samples: the picture's, where they are known."""
        height, width = picture.opacity.shape
        cache = picture.cache
        samples = object_samples(self.segmentation, self.scene.field, cache) if samples is None else samples
        planes = weigh_cache(self.recoloring, samples, cache)
        weights = np.zeros((*planes.shape[1:], height * width), np.float32)
        weights[..., cache.index.cpu().numpy()] = planes.permute(1, 2, 0).cpu().numpy()
        return weights.reshape(*planes.shape[1:], height, width)

    def recolor(self, frame: Frame, edit: Edit) -> np.ndarray:
        """The frame's base with an edit, float32 [H, W, 3]."""
        edited = stack_palettes(self.objects, edit.colors)
        if edit.compositing == "paper":
            return paper_composite(frame.base, frame.palette_weights, frame.probabilities, edited)
        return delta_composite(frame.base, frame.palette_weights, self.learned, edited)


def run(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Render the requested views. With planes, which belong to the project, it is held for writing."""
    project = opened(request.project)
    project.require("geometry")
    with writing(project) if request.options.get("planes") else nullcontext():
        with consistent(project):
            job = open_job(request, emit, should_stop)
            renderer = Renderer(job)
        _render(job, renderer)


def _render(job: Job, renderer: Renderer) -> None:
    options = job.options
    if options.get("edit") or options.get("planes"):
        job.project.require("recoloring")
    if not options.get("out") and not options.get("planes"):
        raise BadRequest("The render stage was given nowhere to write.", "Name a folder with --out.")
    views, captured = select_views(job, options.get("views", "test"))
    edits = read_edits(options.get("edit"), views, renderer.palettes, job.settings.compositing)
    on_photo = captured and (options.get("base") or BASES[job.settings.compositing]) == "photo"
    progress = job.progress("render", len(views))
    job.emit("stage", name="render", text=f"{len(views)} views")
    for view, edit in zip(views, edits, strict=True):
        plate = job.plates([view])[0] if on_photo else None
        shown = view if captured is False or plate is not None else replace(view, camera=_working_camera(job, view))
        frame = renderer.frame(shown, plate, "photo" if on_photo else "field")
        if options.get("out"):
            _write_frame(job, Path(options["out"]), view.name, frame, renderer, edit)
        if options.get("planes"):
            _write_planes(job, view, frame, renderer, captured)
        progress.step()
    if options.get("out"):
        job.artifact("frames", Path(options["out"]))


def _working_camera(job: Job, view: View):
    factor = min(1.0, job.settings.geometry.long_side / max(view.camera.width, view.camera.height))
    size = max(1, round(view.camera.width * factor)), max(1, round(view.camera.height * factor))
    return view.camera.scaled(*size)


def select_views(job: Job, wanted: str) -> tuple[list[View], bool]:
    """The views that `views` names, and whether they are captured ones.

    Raises DataError where a name is unknown or a split is empty.
    """
    capture = job.capture()
    if wanted in ("train", "test", "val", "all"):
        views = list(capture.split(wanted))
        if not views:
            raise DataError(f"{capture.source} has no {wanted} views.", "Use another split, or all.")
        return views, True
    if wanted.endswith(".json"):
        return list(open_capture(Path(wanted), photos=False).views), False
    return [capture.view(name.strip()) for name in wanted.split(",")], True


def read_edits(
    wanted: str | list[str] | None, views: Sequence[View], palettes: Sequence[Palette], compositing: str
) -> list[Edit | None]:
    """The edit of each view: wanted is one file for all, one for each, or None. compositing: see `read_edit`.

    Raises BadRequest where there are as many files as views in no way, DataError where one is no edit of these palettes.
    """
    paths = wanted if isinstance(wanted, list) else [wanted] * len(views)
    if len(paths) != len(views) or not all(path is None or isinstance(path, str) for path in paths):
        raise BadRequest(
            f"The render stage was given {len(paths)} edits for {len(views)} views.",
            "Give one edit file for all, or a list with one for each view.",
        )
    known = {path: read_edit(Path(path), palettes, compositing) for path in set(paths) if path}
    return [known.get(path) for path in paths]


def _write_frame(job: Job, out: Path, name: str, frame: Frame, renderer: Renderer, edit: Edit | None) -> None:
    write_png(out / "render" / f"{name}.png", frame.picture.color.cpu().numpy())
    for object_name, mask in zip(renderer.objects, frame.masks, strict=True):
        write_png(out / "masks" / object_name / f"{name}.png", mask)
    if edit is not None:
        write_png(out / "recolor" / f"{name}.png", renderer.recolor(frame, edit))
    if job.options.get("depth"):
        depth = frame.picture.depth.cpu().numpy().astype(np.float32)
        atomic_write(out / "depth" / f"{name}.npy", lambda temporary: np.save(temporary, depth))


def _write_planes(job: Job, view: View, frame: Frame, renderer: Renderer, captured: bool) -> None:
    planes = Planes(
        tuple(renderer.objects),
        frame.palette_weights.astype(np.float16),
        frame.probabilities.astype(np.float16),
        to_bytes(frame.base),
    )
    if job.options.get("out"):
        write_planes(Path(job.options["out"]) / "planes" / f"{view.name}.npz", planes)
    if captured:
        write_planes(job.project.planes_file(view.name), planes)
        job.artifact("planes", job.project.planes_file(view.name))
