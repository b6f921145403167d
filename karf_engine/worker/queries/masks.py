"""The objects' masks of a captured view as they are segmented, in a second or two."""

from __future__ import annotations

from typing import Any

from ...errors import BadRequest
from .options import needed
from .session import Session


def masks(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """How far each object covers each pixel of a view, at the size that was learned from, in the photo's own grid.

    Options: `project`; `view`, its name.

    Returns:
        `masks`, {object: path of an 8-bit PNG}; the caller's to delete.

    Raises:
        KarfError: Nothing is segmented, there is no such view, or an option is wrong.
    """
    from ...io.images import write_png

    model = session.model(needed(options, "project", str))
    if not model.objects:
        raise BadRequest("No object is segmented yet.", "Segment first.")
    view = model.capture.view(needed(options, "view", str))
    coverages = model.look(model.working_camera(view)).probabilities
    files = {name: session.file(f"{name}-{view.name}.png") for name in model.objects}
    for path, coverage in zip(files.values(), coverages, strict=True):
        write_png(path, coverage)
    return {"masks": {name: str(path) for name, path in files.items()}}
