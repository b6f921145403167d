"""Convert 360-degree photos of a capture to ordinary ones: the faces of the cube around each.

OUT/transforms.json has the views; OUT/images/ the faces, named VIEW_front, VIEW_right and so on. Other photos of the capture
stay where they are. OUT appears only when it is complete.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ..capture import read_capture
from ..capture.camera import Panorama
from ..capture.capture import View
from ..capture.panoramas import face_camera, sample_face
from ..capture.training_images import photo_path
from ..capture.transforms import write_capture
from ..compute.progress import Emit, Progress
from ..errors import DataError
from ..io.files import new_folder
from ..io.images import apply_exif_orientation_copy
from ..recolor.photos import from_camera, open_photo, suffix_for, write_photo
from .options import PinholeOptions


def run(options: PinholeOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Write the capture. Raises DataError where it has no 360-degree photo, or one is damaged."""
    out = options.out.absolute()
    capture = read_capture(options.capture)
    count = sum(isinstance(view.camera, Panorama) for view in capture.views)
    if not count:
        raise DataError("{path} has no 360-degree photos.", "Open it as it is.", path=options.capture)
    faces = options.face_names()
    with new_folder(out) as folder:
        emit("stage", name="pinhole", text=f"{count} 360-degree photos")
        (folder / "images").mkdir()
        progress = Progress(emit, should_stop, "pinhole", count * len(faces))
        views: list[View] = []
        for view in capture.views:
            if isinstance(view.camera, Panorama):
                views += _faces(view, view.camera, faces, options.size, folder / "images", progress)
            else:
                views.append(view)
        for remark in capture.warnings:
            emit("warning", code="capture", sentence=remark)
        write_capture(folder / "transforms.json", replace(capture, views=tuple(views)), out)
    emit("artifact", kind="capture", path=str(out))


def _faces(
    view: View, camera: Panorama, faces: tuple[str, ...], size: int | None, folder: Path, progress: Progress
) -> list[View]:
    """Write the faces of a view's photo, in its format, depth and color space, and return their views."""
    photo = replace(
        open_photo(photo_path(view), view.space), keeps_xmp=False
    )  # it says that this is a 360-degree photo
    if photo.pixels.shape[-1] == 1:
        photo = photo.copy()  # of gray light
    orientation = photo.orientation_for(camera)
    upright = apply_exif_orientation_copy(photo.pixels, orientation)
    side = size or camera.width // 4
    found = []
    for face in faces:
        name = f"{view.name}_{face}"
        path = folder / f"{name}{suffix_for(photo, jpeg=True)}"
        own = replace(photo, pixels=from_camera(sample_face(upright, face, side), orientation)).resized(side)
        write_photo(path, replace(own, pixels=own.pixels.astype(photo.pixels.dtype)))
        found.append(replace(view, name=name, stem=name, camera=face_camera(camera, face, side), image=path))
        progress.step()
    return found
