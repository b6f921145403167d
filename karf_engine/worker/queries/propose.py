"""The query `propose`: a mask of one photo from a box, clicks or a lasso; the photo is cached from click to click."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...errors import BadRequest
from .session import Session


def propose(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """Write the mask of an object.

    Args:
        session: Caches the last photo.
        options: `capture` and `view`; `prompts`, see `Prompts.from_json`; optionally `weights`, the folder of a Segment
            Anything model.

    Returns:
        `mask`, the path of an 8-bit PNG of the photo's size, white inside the object.

    Raises:
        KarfError: The prompts are wrong, or the photo or the weights cannot be read.
    """
    from ...io.images import write_png
    from ...segmentation.marking.prompts import Prompts
    from ...segmentation.marking.proposals import make_marker

    missing = [name for name in ("capture", "view", "prompts") if not options.get(name)]
    if missing:
        raise BadRequest(f"A mask was asked for without {' and '.join(missing)}.", "Give capture, view and prompts.")
    capture, view, weights = Path(options["capture"]), options["view"], options.get("weights")
    version = capture, view, weights, capture.stat().st_mtime_ns
    marker = session.cached("marker", version, lambda: make_marker(capture, view, weights))
    path = session.file("mask.png")
    write_png(path, marker.propose(Prompts.from_json(options["prompts"])))
    return {"mask": str(path)}
