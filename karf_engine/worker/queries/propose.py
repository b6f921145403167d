"""The kind `propose`: from a box, clicks or a lasso to a mask of one photo, which is kept from click to click."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...errors import BadRequest
from .session import Session


def propose(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """The mask of an object.

    Args:
        session: Keeps the photo that was marked last.
        options: `capture` and `view`; `prompts`, see `Prompts.from_json`; and `weights`, the folder of a Segment
            Anything model, where one is to be used.

    Returns:
        `mask`, the path of an 8-bit PNG as large as the photo, white where the object is.

    Raises:
        KarfError: The prompts are wrong, or the photo or the weights cannot be read.
    """
    from ...io.images import write_png
    from ...segmentation.marking.prompts import Prompts
    from ...segmentation.marking.views import marker_of

    missing = [name for name in ("capture", "view", "prompts") if not options.get(name)]
    if missing:
        raise BadRequest(f"A mask was asked for without {' and '.join(missing)}.", "Give capture, view and prompts.")
    capture, view, weights = Path(options["capture"]), options["view"], options.get("weights")
    mark = capture, view, weights, capture.stat().st_mtime_ns
    marker = session.held("marker", mark, lambda: marker_of(capture, view, weights))
    path = session.file("mask.png")
    write_png(path, marker.propose(Prompts.from_json(options["prompts"])))
    return {"mask": str(path)}
