"""Write the mask of an object in one photo, from a box, clicks or a lasso."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..compute.progress import Emit
from ..segmentation.marking.prompts import Prompts
from ..segmentation.marking.proposals import make_marker, write_mask
from .options import MarkOptions


def run(options: MarkOptions, emit: Emit, should_stop: Callable[[], bool]) -> Path:
    """Write the mask and return its file. Raises KarfError for an unknown view, or without prompts."""
    del should_stop  # seconds at most
    prompts = Prompts.from_json({"box": options.box, "points": options.points, "lasso": options.lasso})
    marker = make_marker(options.capture, options.view, options.weights)
    path = write_mask(marker, prompts, options.masks, options.object_name, options.view)
    emit("artifact", kind="mask", path=str(path))
    return path
