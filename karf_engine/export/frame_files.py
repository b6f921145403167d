"""The files of one rendered view."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..capture.camera import Camera
from ..capture.capture import View
from ..commands.job import Job
from ..errors import BadRequest
from ..io.files import atomic_write
from ..io.images import write_png
from ..palettes.added import palettes_with, spread_objects
from ..palettes.compositing import write_planes
from ..palettes.palette import AddedColor, Edit
from ..recolor.frames import Frame, planes_of, with_alpha
from ..recolor.full_resolution import PhotoView
from ..recolor.model import Model
from ..recolor.photos import suffix_for, write_mask, write_photo
from .frame_formats import FORMATS, write_frame
from .layers import Layers, write_layers


def size_of(wanted: str | int | None) -> str | int:
    """The size of recolored photos that was asked for: `photo`, `learned`, or pixels. Raises BadRequest for others."""
    if wanted in (None, "photo", "learned"):
        return wanted or "photo"
    if not str(wanted).isascii() or not str(wanted).isdigit() or int(wanted) < 1:
        raise BadRequest(f"{wanted!r:.200} is no size.", "Use photo, learned, or the long side in pixels.")
    return int(wanted)


def check_format(wanted: str | None) -> None:
    """Raise BadRequest for a format of recolored frames that is none."""
    if wanted is not None and wanted not in FORMATS:
        raise BadRequest(f"Unknown format {wanted!r:.200}.", f"Use one of: {', '.join(FORMATS)}.")


def write_view(job: Job, model: Model, view: View, edit: Edit | None, captured: bool) -> tuple[list[Path], set[str]]:
    """Write what the job asks for of a view.

    Returns:
        The files in its output folder, and the objects about which photo and field disagree.
    """
    files = _Files(job, model, view, edit, captured)
    if captured and model.base_of(job.options.get("base")) == "photo":
        files.write_photo()
    else:
        files.write_rendering()
    return files.written, files.disputed


@dataclass(frozen=True)
class _Files:
    job: Job
    model: Model
    view: View
    edit: Edit | None
    captured: bool
    written: list[Path] = field(default_factory=list)
    disputed: set[str] = field(default_factory=set)

    @property
    def added(self) -> dict[str, tuple[AddedColor, ...]]:
        """The colors that the edit adds, which have layers of their own."""
        return {} if self.edit is None else self.edit.added

    def write_rendering(self) -> None:
        camera = self.model.working_camera(self.view) if self.captured else self.view.camera
        frame = self.model.render(camera, self.job.settings.render.supersampling)
        if self.job.options.get("out"):
            behind = self.model.behind(camera) if self.job.options.get("alpha") else None
            self._scene(camera.without_distortion(), frame, behind)
            self._frame(frame, behind)
        if self.job.options.get("planes"):
            self._planes(frame)

    def write_photo(self) -> None:
        if self.job.options.get("out"):
            pinhole = self.model.working_camera(self.view).without_distortion()
            behind = self.model.behind(pinhole) if self.job.options.get("alpha") else None
            self._scene(pinhole, self.model.look(pinhole), behind)
            size = size_of(self.job.options.get("size"))
            if size == "learned":
                self._frame(self.model.preview(self.view, self.job.settings.geometry.long_side), None)
            else:
                self._photo(self.model.photo_view(self.view, size))
        if self.job.options.get("planes"):
            self._planes(self.model.preview(self.view))

    def _scene(self, pinhole: Camera, frame: Frame, behind: np.ndarray | None) -> None:
        """The scene as learned, its depth, and where its objects are unsure."""
        write_png(self._path("render", ".png"), _cut_out(frame.color, frame, behind))
        if self.job.options.get("depth"):
            atomic_write(self._path("depth", ".npy"), lambda temporary: np.save(temporary, frame.depth))
        if self.job.options.get("unsure"):
            for name, plane in zip(self.model.objects, self.model.unsure(pinhole, frame), strict=True):
                write_png(self._path(f"unsure/{name}", ".png"), plane)

    def _frame(self, frame: Frame, behind: np.ndarray | None) -> None:
        """Masks, recolored picture and layers of a frame; behind: what to take out of the picture."""
        self.disputed.update(frame.disputed)
        for name, mask in zip(self.model.objects, frame.masks, strict=True):
            write_png(self._path(f"masks/{name}", ".png"), mask)
        if self.edit is not None:
            kind = self.job.options.get("format", "png8")
            picture = _cut_out(self.model.composite(frame, self.edit), frame, behind)
            write_frame(self._path("recolor", FORMATS[kind]), picture, kind)
        if self.job.options.get("layers"):
            palettes = palettes_with(self.model.palettes, self.added)
            weights = spread_objects(frame.palette_weights, self.model.palettes, self.added)
            layers = Layers(palettes, frame.base, frame.probabilities, weights, frame.depth)
            write_layers(self._path("layers", ".exr"), layers)

    def _photo(self, finished: PhotoView) -> None:
        """The same in the photo's own pixels."""
        self.disputed.update(finished.disputed)
        for name, mask in zip(finished.objects, finished.masks(), strict=True):
            write_mask(self._path(f"masks/{name}", ".png"), mask, finished.photo.header.orientation)
        if self.edit is not None:
            suffix = suffix_for(finished.photo, bool(self.job.options.get("jpeg")))
            write_photo(self._path("recolor", suffix), finished.recolored(self.edit))
        if self.job.options.get("layers"):
            depth = self.model.look(self.model.working_camera(self.view)).depth
            write_layers(self._path("layers", ".exr"), finished.layers(depth, self.added))

    def _planes(self, frame: Frame) -> None:
        self.disputed.update(frame.disputed)
        planes = planes_of(frame, self.model.objects)
        if self.captured:
            own = self.job.project.planes_file(self.view.name)
            write_planes(own, planes)
            self.job.artifact("planes", own)
        if self.job.options.get("out"):
            write_planes(self._path("planes", ".npz"), planes)

    def _path(self, kind: str, suffix: str) -> Path:
        self.written.append(Path(self.job.options["out"]) / kind / f"{self.view.name}{suffix}")
        return self.written[-1]


def _cut_out(color: np.ndarray, frame: Frame, behind: np.ndarray | None) -> np.ndarray:
    return color if behind is None else with_alpha(color, frame.opacity, behind)
