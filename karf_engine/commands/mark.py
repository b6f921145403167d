"""The mask of an object in one photo, from a box, clicks or a lasso."""

from __future__ import annotations

from pathlib import Path

from ..segmentation.marking.prompts import Prompts
from ..segmentation.marking.views import marker_of, write_mask
from .options.capturing import MarkOptions


def write(options: MarkOptions) -> Path:
    """Write the mask; returns its file. Raises KarfError where the view is unknown or nothing says where the object is."""
    prompts = Prompts.from_json({"box": options.box, "points": options.points, "lasso": options.lasso})
    marker = marker_of(options.capture, options.view, options.weights)
    return write_mask(marker, prompts, options.masks, options.object_name, options.view)
