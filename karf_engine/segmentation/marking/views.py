"""A captured view that is being marked, and its mask on disk."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from ...capture import open_capture
from ...capture.training_images import photo_of
from ...errors import BadRequest
from ...io.images import write_png
from ...io.names import is_file_name
from .prompts import Prompts
from .proposals import Marker


class Marking(Protocol):
    """A photo that is being marked."""

    def propose(self, prompts: Prompts) -> np.ndarray:
        """The mask of the object that the prompts mean, bool [H, W]."""


def marker_of(capture: Path | str, name: str, weights: Path | str | None = None) -> Marking:
    """Begin to mark a view.

    Args:
        capture: The capture's folder or camera file.
        name: The view's.
        weights: The folder of a Segment Anything model, which then proposes the mask.

    Raises:
        KarfError: The capture has no such view, its photo cannot be read, or the weights cannot be used.
    """
    photo = photo_of(open_capture(capture).view(name))
    if weights is None:
        return Marker(photo)
    from .segment_anything import SegmentAnything  # needs torch

    return SegmentAnything(photo, weights)


def write_mask(marking: Marking, prompts: Prompts, masks: Path, object_name: str, view: str) -> Path:
    """Write what prompts mean as MASKS/<object>/<view>.png; returns the file.

    Raises:
        BadRequest: The object's name cannot be a folder's, or the prompts are empty.
    """
    if not is_file_name(object_name):
        raise BadRequest(f"{object_name!r:.200} cannot be the name of a folder.", "Call the object by a plain name.")
    path = masks / object_name / f"{view}.png"
    write_png(path, marking.propose(prompts))
    return path
