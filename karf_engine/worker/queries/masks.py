"""The query `masks`: the segmented objects' masks of a captured view, in a second or two."""

from __future__ import annotations

from typing import Any

from ...errors import BadRequest
from .options import require_option
from .session import Session


def masks(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """Write each object's coverage of a view at the training size, with the photo's lens distortion.

    Options: `project`; `view`, its name.

    Returns:
        `masks`, {object: path of an 8-bit PNG}, for the caller to delete.

    Raises:
        KarfError: Nothing is segmented, the view is unknown, or an option is wrong.
    """
    from ...io.images import write_png

    model = session.model(require_option(options, "project", str))
    if not model.objects:
        raise BadRequest("No object is segmented yet.", "Segment first.")
    view = model.capture.view(require_option(options, "view", str))
    coverages = model.render_field(model.working_camera(view)).probabilities
    files = {name: session.file(f"{name}-{view.name}.png") for name in model.objects}
    for path, coverage in zip(files.values(), coverages, strict=True):
        write_png(path, coverage)
    return {"masks": {name: str(path) for name, path in files.items()}}
