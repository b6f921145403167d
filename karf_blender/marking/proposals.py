"""Clicks and boxes: the engine makes a mask of them, which appears when it comes, and later ones refine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .. import preferences
from ..pictures import images
from ..project import captures
from . import history, mask_layers
from .raster import Place


@dataclass(frozen=True)
class Proposal:
    """What the engine makes a mask of, and what that mask joins.

    Attributes:
        name: The object's.
        view: The view's name.
        before: The mask before the first click, its bits packed.
        adds: Whether the answer joins what was there before; else it is taken away from it.
        box: (x0, y0, x1, y1) in pixels of the photo, or None.
        points: (x, y, whether that is the object).
    """

    name: str
    view: str
    before: bytes
    adds: bool
    box: tuple[float, float, float, float] | None = None
    points: tuple[tuple[float, float, bool], ...] = ()

    def prompts(self) -> dict[str, Any]:
        """As the engine reads them: what is taken away is looked for as if it were the object."""
        points = [[x, y, is_object == self.adds] for x, y, is_object in self.points]
        return {"box": list(self.box) if self.box else None, "points": points, "lasso": None}

    def joined(self, answer: np.ndarray) -> np.ndarray:
        """The mask [H, W] int8 that an answer [H, W] leads to."""
        bits = np.unpackbits(np.frombuffer(self.before, np.uint8), count=answer.size)
        before = bits.reshape(answer.shape).astype(bool)
        return (before | answer if self.adds else before & ~answer).astype(np.int8)


def shown(scene: bpy.types.Scene, name: str) -> Proposal | None:
    """The clicks and the box that the object's mask in the active view is being made of."""
    found = history.note()
    is_of_it = isinstance(found, Proposal) and (found.name, found.view) == (name, scene.karf.active_view)
    return found if is_of_it else None


def click(scene: bpy.types.Scene, name: str, place: Place, is_object: bool) -> Proposal:
    """The proposal with one more click."""
    proposal = shown(scene, name) or _begin(scene, name, is_object)
    return replace(proposal, points=(*proposal.points, (*place, is_object)))


def box(scene: bpy.types.Scene, name: str, corner: Place, other: Place) -> Proposal:
    """A proposal with this box, and no click yet."""
    (x0, x1), (y0, y1) = (sorted(pair) for pair in zip(corner, other, strict=True))
    return replace(_begin(scene, name, True), box=(x0, y0, x1, y1))


def _begin(scene: bpy.types.Scene, name: str, is_object: bool) -> Proposal:
    before = mask_layers.open_layers(scene).layer(name, is_correction=False).pixels > 0
    return Proposal(name, scene.karf.active_view, np.packbits(before).tobytes(), is_object or not before.any())


def note(scene: bpy.types.Scene, proposal: Proposal) -> tuple[int, dict[str, Any]]:
    """Take a proposal as a step that undo takes back.

    Returns:
        The step's number, and what the engine is to be asked.
    """
    step = history.record(scene, mask_layers.root_of(scene, False), {}, proposal)
    options = {"capture": str(captures.path_of(scene)), "view": proposal.view, "prompts": proposal.prompts()}
    return step, options | {"weights": preferences.current().marking_model or None}


def take(scene: bpy.types.Scene, step: int, proposal: Proposal, file: Path) -> None:
    """The engine's answer has come: it becomes the mask, unless undo has taken the step back meanwhile.

    Raises:
        KarfError: The answer cannot be read.
        OSError: The mask cannot be written.
    """
    pixels = proposal.joined(images.read_mask(file))
    view = captures.view_of(scene, proposal.view)
    if not history.amend(step, mask_layers.files_of(scene, view, proposal.name, False, pixels)):
        return
    layers = mask_layers.shown(scene)
    if layers is not None and layers.view.name == proposal.view:
        layer = layers.layer(proposal.name, is_correction=False)
        layer.pixels = pixels
        layer.touch()
    mask_layers.follow(scene)
