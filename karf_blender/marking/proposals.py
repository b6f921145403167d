"""Masks that the engine proposes for clicks and a box; later clicks refine them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .. import preferences
from ..host import windows
from ..pictures import images
from ..project import captures, disk
from ..tasks import queries
from . import history, mask_layers, objects
from .raster import Place


@dataclass(frozen=True)
class Proposal:
    name: str  # of the object
    view: str
    before: bytes  # the mask before the first click, its bits packed
    adds: bool  # whether the answer is added to that mask; else it is subtracted
    box: tuple[float, float, float, float] | None = None  # x0, y0, x1, y1 in pixels of the photo
    points: tuple[tuple[float, float, bool], ...] = ()  # x, y, is the object

    def prompts(self) -> dict[str, Any]:
        """Return the engine's prompts; if the answer is subtracted, it is segmented like an object."""
        points = [[x, y, is_object == self.adds] for x, y, is_object in self.points]
        return {"box": list(self.box) if self.box else None, "points": points, "lasso": None}

    def combined(self, answer: np.ndarray) -> np.ndarray:
        """Return the mask [H, W] int8 after an answer [H, W]."""
        bits = np.unpackbits(np.frombuffer(self.before, np.uint8), count=answer.size)
        before = bits.reshape(answer.shape).astype(bool)
        return (before | answer if self.adds else before & ~answer).astype(np.int8)


def current(scene: bpy.types.Scene, name: str) -> Proposal | None:
    """Return the clicks and the box of an object's mask in the active view."""
    note = history.note()
    is_its = isinstance(note, Proposal) and (note.name, note.view) == (name, scene.karf.active_view)
    return note if is_its else None


def click(scene: bpy.types.Scene, name: str, place: Place, is_object: bool) -> Proposal:
    """Return the current proposal with one more click."""
    proposal = current(scene, name) or _begin(scene, name, is_object)
    return replace(proposal, points=(*proposal.points, (*place, is_object)))


def box(scene: bpy.types.Scene, name: str, corner: Place, other: Place) -> Proposal:
    """Return a new proposal with a box."""
    (x0, x1), (y0, y1) = (sorted(pair) for pair in zip(corner, other, strict=True))
    return replace(_begin(scene, name, True), box=(x0, y0, x1, y1))


def _begin(scene: bpy.types.Scene, name: str, is_object: bool) -> Proposal:
    before = mask_layers.open_layers(scene).layer(name, is_correction=False).pixels > 0
    return Proposal(name, scene.karf.active_view, np.packbits(before).tobytes(), is_object or not before.any())


def propose(scene: bpy.types.Scene, proposal: Proposal) -> None:
    """Request the mask of a proposal, as a step of undo; it is written when it comes. Raises KarfError."""
    step = history.record(scene, objects.masks_folder(scene), {}, proposal)
    windows.redraw()
    options = {
        "capture": str(captures.path_of(scene)),
        "view": proposal.view,
        "prompts": proposal.prompts(),
        "weights": preferences.current().marking_model or None,
    }
    queries.send(scene, "propose", options, partial(_take, step, proposal))


def _take(step: int, proposal: Proposal, scene: bpy.types.Scene, values: dict[str, Any]) -> None:
    """Write the answer's mask, unless undo has taken the step back; redo brings it then."""
    file = Path(values["mask"])
    pixels = proposal.combined(images.read_mask(file))
    view = captures.view_of(scene, proposal.view)
    if history.amend(step, mask_layers.mask_files(scene, view, proposal.name, pixels)):
        layers = mask_layers.opened(scene)
        if layers is not None and layers.view.name == proposal.view:
            layer = layers.layer(proposal.name, is_correction=False)
            layer.pixels = pixels
            layer.touch()
        windows.redraw()
    file.unlink(missing_ok=True)
    disk.refresh()
