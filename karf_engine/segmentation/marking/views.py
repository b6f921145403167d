"""Mark a view of a capture, and write its mask."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from ...capture import open_capture
from ...capture.training_images import read_photo_of_view
from ...errors import BadRequest
from ...io.images import write_png
from ...io.names import is_file_name
from .prompts import Prompts
from .proposals import Marker


class Marking(Protocol):
    """A photo with a method that proposes masks."""

    def propose(self, prompts: Prompts) -> np.ndarray:
        """Return the object's mask, bool [H, W]."""
        ...


def make_marker(capture: Path | str, name: str, weights: Path | str | None = None) -> Marking:
    """Load a view for marking.

    Args:
        capture: folder or camera file of the capture.
        name: of the view.
        weights: folder of a Segment Anything model, to use instead of GrabCut.

    Raises:
        KarfError: the capture has no such view, its photo cannot be read, or the weights cannot be used.
    """
    photo = read_photo_of_view(open_capture(capture).view(name))
    if weights is None:
        return Marker(photo)
    from .segment_anything import SegmentAnything  # needs torch

    return SegmentAnything(photo, weights)


def write_mask(marking: Marking, prompts: Prompts, masks: Path, object_name: str, view: str) -> Path:
    """Write the proposed mask to MASKS/<object>/<view>.png and return the path.

    Raises BadRequest where the object's name cannot be a folder's, or the prompts are empty.
    """
    if not is_file_name(object_name):
        raise BadRequest(f"{object_name!r:.200} cannot be the name of a folder.", "Call the object by a plain name.")
    path = masks / object_name / f"{view}.png"
    write_png(path, marking.propose(prompts))
    return path
