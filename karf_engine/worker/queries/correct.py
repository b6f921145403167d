"""Masks of a view as a project's corrections have them now, in seconds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...capture.camera import Camera
from ...capture.distortion import straighten
from ...compute.progress import Progress
from ...io.files import checksum
from ...io.images import resize, write_png
from ...project import Project
from ...project.contents import capture_of, settings_for
from ...project.volumes import read_volumes
from .options import needed
from .session import Session

if TYPE_CHECKING:
    from ...capture.capture import View
    from ...segmentation.coarse_masks import CoarseMask
    from ...segmentation.correcting import Correcting


def correct(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """Heed a project's corrections and show what becomes of a view. The first time it looks at the whole scene.

    Options: `project`; `view`, its name; `masks` and `corrections`, folders, by default the project's own.

    Returns:
        `masks`, {object: path of a PNG}, as large as the photo and in its own grid; the caller's to delete.

    Raises:
        KarfError: Geometry is not learned, a mark cannot be read, or an option is wrong.
        Cancelled: A later query of this kind waits.
    """
    from ...segmentation.coarse_masks import find_masks  # need torch, without which some kinds can be answered
    from ...segmentation.correcting import Correcting
    from ...segmentation.corrections import find_corrections

    project = Project(needed(options, "project", str))
    geometry = project.require("geometry")["fingerprint"]
    capture = capture_of(project)
    view = capture.view(needed(options, "view", str))
    masks = find_masks(project.contained(Path(options.get("masks") or project.masks_folder)), capture)
    corrections = find_corrections(
        project.contained(Path(options.get("corrections") or project.corrections_folder)), capture
    )

    def begun() -> Correcting:
        field = session.model(str(project.folder)).scene.field
        progress = Progress(lambda *_, **__: None, session.is_superseded, "surface", 1)
        settings = settings_for(project, "segmentation")
        return Correcting(field, capture, masks, corrections, settings, progress, read_volumes(project.volumes_file))

    volumes = checksum(project.volumes_file) if project.volumes_file.exists() else ""
    objects = sorted({mark.object_name for mark in (*masks, *corrections)})
    correcting = session.held(("correcting", project.folder), (geometry, _digests(masks), objects, volumes), begun)
    given = id(correcting), _digests(corrections)
    session.held(("corrected", project.folder), given, lambda: correcting.correct(corrections))
    return {"masks": _written(session, correcting, view)}


def _digests(marks: list[CoarseMask]) -> list:
    return [(mark.object_name, mark.view.name, checksum(mark.path)) for mark in marks]


def _written(session: Session, correcting: Correcting, view: View) -> dict[str, str]:
    """Write the masks of a view; the files by their objects."""
    files = {}
    for name, mask in correcting.masks(view).items():
        path = session.file(f"{name}-{view.name}.png")
        write_png(path, _in_photo(mask, view.camera))
        files[name] = str(path)
    return files


def _in_photo(mask: np.ndarray, stored: Camera) -> np.ndarray:
    """A mask of a view's pinhole, bool [H, W] of any size, as the photo has it with its lens and size."""
    height, width = mask.shape
    lens = stored.scaled(width, height)
    x, y = np.nan_to_num(straighten(lens, lens.pixel_centers()), nan=-1).T
    seen = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    bent = np.zeros(mask.size, np.float32)
    bent[seen] = mask[y[seen].astype(int), x[seen].astype(int)]
    return resize(bent.reshape(mask.shape), stored.width, stored.height) >= 0.5
