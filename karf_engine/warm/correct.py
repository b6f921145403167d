"""Masks of views as a project's corrections have them now, in seconds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files import checksum
from ..images import write_png
from ..progress import Progress
from ..project import Project
from ..project.contents import capture_of, settings_for
from .options import needed
from .session import Session

if TYPE_CHECKING:
    from ..capture.capture import View
    from ..segmentation.coarse_masks import CoarseMask
    from ..segmentation.correcting import Correcting


def correct(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """Heed a project's corrections and show what becomes of views. The first time it looks at the whole scene.

    Options: `project`; `view`, a name or several with commas; `masks` and `corrections`, folders, by default the
    project's own.

    Returns:
        `masks`, {view: {object: path of a PNG}}, as the view's pinhole shows them at the working size; the caller's to
        delete.

    Raises:
        KarfError: Geometry is not learned, a mark cannot be read, or an option is wrong.
        Cancelled: Others are wanted by now.
    """
    from ..segmentation.coarse_masks import find_masks  # need torch, without which some kinds can be answered
    from ..segmentation.correcting import Correcting
    from ..segmentation.corrections import find_corrections

    project = Project(needed(options, "project", str))
    geometry = project.require("geometry")["fingerprint"]
    capture = capture_of(project)
    views = [capture.view(name.strip()) for name in needed(options, "view", str).split(",")]
    masks = find_masks(Path(options.get("masks") or project.masks_folder), capture)
    corrections = find_corrections(Path(options.get("corrections") or project.corrections_folder), capture)

    def begun() -> Correcting:
        field = session.model(str(project.folder)).scene.field
        progress = Progress(lambda *_, **__: None, session.is_superseded, "surface", 1)
        return Correcting(field, capture, masks, corrections, settings_for(project, "segmentation"), progress)

    objects = sorted({mark.object_name for mark in (*masks, *corrections)})
    correcting = session.held(("correcting", project.folder), (geometry, _digests(masks), objects), begun)
    given = id(correcting), _digests(corrections)
    session.held(("corrected", project.folder), given, lambda: correcting.correct(corrections))
    return {"masks": {view.name: _written(session, correcting, view) for view in views}}


def _digests(marks: list[CoarseMask]) -> list:
    return [(mark.object_name, mark.view.name, checksum(mark.path)) for mark in marks]


def _written(session: Session, correcting: Correcting, view: View) -> dict[str, str]:
    """Write the masks of a view; the files by their objects."""
    files = {}
    for name, mask in correcting.masks(view).items():
        path = session.file(f"{name}-{view.name}.png")
        write_png(path, mask)
        files[name] = str(path)
    return files
