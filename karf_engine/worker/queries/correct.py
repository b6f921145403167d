"""The query `correct`: the masks of a view after a project's current corrections, in seconds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...capture.camera import Camera
from ...capture.distortion import undistort_points
from ...compute.progress import Progress
from ...io.files import checksum
from ...io.images import resize, write_png
from ...project import Project
from ...project.contents import read_capture, settings_for
from ...project.volumes import read_volumes
from .options import require_option
from .session import Session

if TYPE_CHECKING:
    from ...capture.capture import View
    from ...segmentation.coarse_masks import CoarseMask
    from ...segmentation.labels import CorrectionSession


def correct(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """Apply a project's corrections and write the masks of a view. The first call takes longer: it labels the whole scene.

    Options: `project`; `view`, its name; `masks` and `corrections`, folders, by default the project's own.

    Returns:
        `masks`, {object: path of a PNG} in the photo's pixel grid, for the caller to delete.

    Raises:
        KarfError: Geometry is not learned, a mark cannot be read, or an option is wrong.
        Cancelled: A later query of this kind is waiting.
    """
    from ...segmentation.coarse_masks import find_masks  # need torch
    from ...segmentation.corrections import find_corrections
    from ...segmentation.labels import CorrectionSession

    project = Project(require_option(options, "project", str))
    geometry = project.require("geometry")["fingerprint"]
    capture = read_capture(project)
    view = capture.view(require_option(options, "view", str))
    masks = find_masks(project.check_inside(Path(options.get("masks") or project.masks_folder)), capture)
    corrections = find_corrections(
        project.check_inside(Path(options.get("corrections") or project.corrections_folder)), capture
    )

    def start() -> CorrectionSession:
        field = session.model(str(project.folder)).scene.field
        progress = Progress(lambda *_, **__: None, session.is_superseded, "surface", 1)
        settings = settings_for(project, "segmentation")
        return CorrectionSession(
            field, capture, masks, corrections, settings, progress, read_volumes(project.volumes_file)
        )

    volumes = checksum(project.volumes_file) if project.volumes_file.exists() else ""
    objects = sorted({mark.object_name for mark in (*masks, *corrections)})
    correcting = session.cached(("correcting", project.folder), (geometry, _digests(masks), objects, volumes), start)
    version = id(correcting), _digests(corrections)
    session.cached(("corrected", project.folder), version, lambda: correcting.correct(corrections))
    return {"masks": _write_masks(session, correcting, view)}


def _digests(marks: list[CoarseMask]) -> list:
    return [(mark.object_name, mark.view.name, checksum(mark.path)) for mark in marks]


def _write_masks(session: Session, correcting: CorrectionSession, view: View) -> dict[str, str]:
    """Write the masks of a view and return the files by object."""
    files = {}
    for name, mask in correcting.masks(view).items():
        path = session.file(f"{name}-{view.name}.png")
        write_png(path, _distorted(mask, view.camera))
        files[name] = str(path)
    return files


def _distorted(mask: np.ndarray, stored: Camera) -> np.ndarray:
    """Resample an undistorted mask, bool [H, W] of any size, to the grid of a photo taken with this lens."""
    height, width = mask.shape
    lens = stored.scaled(width, height)
    x, y = np.nan_to_num(undistort_points(lens, lens.pixel_centers()), nan=-1).T
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    distorted = np.zeros(mask.size, np.float32)
    distorted[inside] = mask[y[inside].astype(int), x[inside].astype(int)]
    return resize(distorted.reshape(mask.shape), stored.width, stored.height) >= 0.5
