"""The ask `correct`: masks of views as a project's corrections have them now, in seconds.

Options: project, view (a name, or several with commas), masks (folder of rough masks; the project's own by default),
corrections (folder; the project's own by default). The answer's `masks` are {view: {object: path of an 8-bit PNG}}, as
the view's pinhole shows them at the working size.
The first ask looks at the whole scene, later ones only at what was corrected since.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..files import checksum
from ..images import write_png
from ..progress import Progress
from ..project import Project
from ..project.contents import capture_of, settings_for
from ..segmentation.coarse_masks import CoarseMask, find_masks
from ..segmentation.correcting import Correcting
from ..segmentation.corrections import find_corrections
from .session import Session


def correct(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """See the module's docstring. Raises KarfError where a mark cannot be read, or geometry is not learned."""
    project = Project(options["project"])
    geometry = project.require("geometry")["fingerprint"]
    capture = capture_of(project)
    masks = find_masks(Path(options.get("masks") or project.masks_folder), capture)
    corrections = find_corrections(Path(options.get("corrections") or project.corrections_folder), capture)
    views = [capture.view(name.strip()) for name in options["view"].split(",")]

    def begun() -> Correcting:
        field = session.model(options["project"]).scene.field
        progress = Progress(lambda *_, **__: session.check(), session.is_superseded, "surface", 1)
        return Correcting(field, capture, masks, corrections, settings_for(project, "segmentation"), progress)

    objects = sorted({mark.object_name for mark in (*masks, *corrections)})
    correcting = session.held(("correcting", project.folder), (geometry, _digests(masks), objects), begun)
    session.held(("corrected", project.folder), (id(correcting), _digests(corrections)),
                 lambda: correcting.correct(corrections))  # fmt: skip
    return {"masks": {view.name: _written(session, correcting, view) for view in views}}


def _digests(marks: list[CoarseMask]) -> list:
    return [(mark.object_name, mark.view.name, checksum(mark.path)) for mark in marks]


def _written(session: Session, correcting: Correcting, view) -> dict[str, str]:
    files = {}
    for name, mask in correcting.masks(view).items():
        files[name] = str(session.file(f"{name}-{view.name}.png"))
        write_png(Path(files[name]), mask)
    return files
