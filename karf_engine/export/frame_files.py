"""The files of one rendered view; PNG of 8 or 16 bits and EXR of halves or floats, as in Blender's output panel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import OpenEXR

from ..capture.camera import Camera
from ..capture.capture import View
from ..io.color import srgb_to_linear, to_bytes
from ..io.color_spaces import color_space
from ..io.files import atomic_write
from ..io.images import encode_image, save_exr, write_png
from ..palettes.added import extended_palettes, split_weights_of_objects
from ..palettes.compositing import write_planes
from ..palettes.edge_shape import EdgeShape
from ..palettes.palette import AddedColor, Edit
from ..project.state import result_fingerprint
from ..recolor.frames import Frame, Layers, edit_planes, remove_background
from ..recolor.full_resolution import PhotoView
from ..recolor.model import Model, base_of
from ..recolor.photos import suffix_for, write_mask, write_photo
from .file_names import named, tokens_of
from .frame_options import FORMATS, FrameFileOptions
from .layered import write_layered
from .layers import write_layers


def write_view(
    model: Model,
    view: View,
    edit: Edit | None,
    captured: bool,
    options: FrameFileOptions,
    artifact: Callable[[str, Path], None],
) -> tuple[list[Path], set[str]]:
    """Write the files of a view; return those in the output folder, and the disputed objects (see `Frame.disputed`).

    edit: None for no recolored picture. artifact: called with kind and path of each file written to the project.
    """
    files = _Files(model, view, edit, captured, options, artifact)
    if captured and base_of(model.settings, options.base) == "photo":
        files.write_photo()
    else:
        files.write_rendering()
    return files.written, files.disputed


@dataclass(frozen=True)
class _Files:
    model: Model
    view: View
    edit: Edit | None
    captured: bool
    options: FrameFileOptions
    artifact: Callable[[str, Path], None]
    written: list[Path] = field(default_factory=list)
    disputed: set[str] = field(default_factory=set)

    @property
    def added(self) -> dict[str, tuple[AddedColor, ...]]:
        return {} if self.edit is None else self.edit.added

    @property
    def edges(self) -> dict[str, EdgeShape]:
        return {} if self.edit is None else self.edit.edges

    @property
    def _needs_layers(self) -> bool:
        return self.options.layers or (self.options.layered and self.edit is not None)

    def write_rendering(self) -> None:
        camera = self.model.working_camera(self.view) if self.captured else self.view.camera
        frame = self.model.render(camera, self.model.settings.render.supersampling)
        if self.options.out:
            behind = self.model.render_background(camera) if self.options.alpha else None
            self._scene(camera.without_distortion(), frame, behind)
            self._frame(frame, behind)
        if self.options.planes:
            self._planes(frame)

    def write_photo(self) -> None:
        if self.options.out:
            pinhole = self.model.working_camera(self.view).without_distortion()
            behind = self.model.render_background(pinhole) if self.options.alpha else None
            self._scene(pinhole, self.model.render_field(pinhole), behind)
            if self.options.size == "learned":
                self._frame(self.model.preview(self.view, self.model.settings.geometry.long_side), None)
            else:
                self._photo(self.model.photo_view(self.view, self.options.size))
        if self.options.planes:
            self._planes(self.model.preview(self.view))

    def _scene(self, pinhole: Camera, frame: Frame, behind: np.ndarray | None) -> None:
        """Write the scene as learned, its depth, and the uncertainty of the labels."""
        write_png(self._path("render", ".png"), _cut_out(frame.color, frame, behind))
        if self.options.depth:
            atomic_write(self._path("depth", ".npy"), lambda temporary: np.save(temporary, frame.depth))
        if self.options.unsure:
            for name, plane in zip(self.model.objects, self.model.label_uncertainty(pinhole, frame), strict=True):
                write_png(self._path(f"unsure/{name}", ".png"), plane)

    def _frame(self, frame: Frame, behind: np.ndarray | None) -> None:
        """Write masks, recolored picture and layers of a frame. behind: background to remove from the picture."""
        self.disputed.update(frame.disputed)
        for name, mask in zip(self.model.objects, frame.masks, strict=True):
            write_png(self._path(f"masks/{name}", ".png"), mask)
        if self.edit is not None:
            kind = self.options.format
            picture = _cut_out(self.model.composite(frame, self.edit), frame, behind)
            write_frame(self._recolored(FORMATS[kind]), picture, kind)
        if self._needs_layers:
            frame = self.model.with_edges(frame, self.edges)
            assert frame.palette_weights is not None
            palettes = extended_palettes(self.model.palettes, self.added)
            weights = split_weights_of_objects(frame.palette_weights, self.model.palettes, self.added)
            self._layers(Layers(palettes, frame.base, frame.probabilities, weights, frame.depth, frame.gains))

    def _photo(self, finished: PhotoView) -> None:
        """Write masks, recolored picture and layers in the photo's own pixels."""
        self.disputed.update(finished.disputed)
        for name, mask in zip(finished.objects, finished.masks(), strict=True):
            write_mask(self._path(f"masks/{name}", ".png"), mask, finished.photo.header.orientation)
        if self.edit is not None:
            suffix = suffix_for(finished.photo, self.options.jpeg)
            write_photo(self._recolored(suffix), finished.recolor(self.edit))
        if self._needs_layers:
            depth = self.model.render_field(self.model.working_camera(self.view)).depth
            self._layers(finished.layers(depth, self.added, self.edges))

    def _layers(self, layers: Layers) -> None:
        if self.options.layered and self.edit is not None:
            write_layered(self._recolored("_layered.exr"), layers, self.edit)
        if not self.options.layers:
            return
        name = self.options.layer_space
        space = None if name is None else color_space(name, self.options.ocio)
        write_layers(self._path("layers", ".exr"), layers, space)

    def _planes(self, frame: Frame) -> None:
        self.disputed.update(frame.disputed)
        planes = edit_planes(frame, self.model.objects)
        if self.captured:
            own = self.model.project.planes_file(self.view.name)
            write_planes(own, planes, result_fingerprint(self.model.project.state(), "recoloring"))
            self.artifact("planes", own)
        if self.options.out:
            write_planes(self._path("planes", ".npz"), planes)

    def _recolored(self, suffix: str) -> Path:
        return self._in_folder(f"{named(self.options.names, tokens_of(self.view.name))}{suffix}")

    def _path(self, kind: str, suffix: str) -> Path:
        return self._in_folder(f"{kind}/{self.view.name}{suffix}")

    def _in_folder(self, name: str) -> Path:
        assert self.options.out is not None
        self.written.append(self.options.out / name)
        return self.written[-1]


def _cut_out(color: np.ndarray, frame: Frame, behind: np.ndarray | None) -> np.ndarray:
    return color if behind is None else remove_background(color, frame.opacity, behind)


def write_frame(path: Path, color: np.ndarray, kind: str) -> None:
    """Write a picture, atomically: PNG as sRGB with straight alpha, EXR scene-linear with premultiplied alpha.

    color: sRGB [H, W, 3], or with straight alpha [H, W, 4], in [0, 1]. kind: one of `FORMATS`.
    """
    atomic_write(path, lambda temporary: _write(temporary, color, kind))


def _write(path: Path, color: np.ndarray, kind: str) -> None:
    if kind == "png8":
        path.write_bytes(encode_image(".png", to_bytes(color)))
    elif kind == "png16":
        path.write_bytes(encode_image(".png", np.rint(np.clip(color, 0, 1) * 65535).astype(np.uint16)))
    else:
        light, alpha = srgb_to_linear(color[..., :3]), color[..., 3:]
        if color.shape[-1] == 4:
            light = np.concatenate([light * alpha, alpha], -1)
        pixels = light.astype({"exr16": np.float16, "exr32": np.float32}[kind])
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        save_exr(OpenEXR.File(header, {"RGBA" if pixels.shape[-1] == 4 else "RGB": pixels}), path)
