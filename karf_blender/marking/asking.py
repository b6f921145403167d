"""What the engine is asked while marks are drawn, and what follows when it answers."""

from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..engine_api import KarfError
from ..pictures import images
from ..preferences import state
from ..project import disk
from ..tasks import queries
from . import mask_layers, objects, photo, proposals, tools
from .mask_layers import Layer
from .proposals import Proposal


def propose(scene: bpy.types.Scene, proposal: Proposal) -> None:
    """Ask for the mask of clicks and a box; it is written and shown when it comes.

    Raises:
        KarfError: The engine cannot be started.
    """
    step, options = proposals.note(scene, proposal)
    mask_layers.follow(scene)
    queries.send(scene, "propose", options, partial(_take_proposal, step, proposal))


def _take_proposal(step: int, proposal: Proposal, scene: bpy.types.Scene, values: dict[str, Any]) -> None:
    file = Path(values["mask"])
    proposals.take(scene, step, proposal, file)
    file.unlink(missing_ok=True)
    disk.refresh()


def correct(scene: bpy.types.Scene) -> None:
    """While *Correct* is on: ask for the masks of the active view with all corrections; they are shown as they come.

    Raises:
        KarfError: The engine cannot be started.
    """
    can_answer = "segmentation" in disk.contents_of(scene).stages and not state.known().problem
    if scene.karf.marking.correct and can_answer:
        view = scene.karf.active_view
        options = {"view": view, "masks": str(objects.masks_folder(scene))}
        queries.send(scene, "correct", options, partial(_take_corrected, view))


def _take_corrected(view: str, scene: bpy.types.Scene, values: dict[str, Any]) -> None:
    files = {name: Path(file) for name, file in values["masks"].items()}
    layers = mask_layers.shown(scene)
    if layers is not None and layers.view.name == view:
        layers.solved = {name: Layer(images.read_mask(file).astype(np.int8)) for name, file in files.items()}
        mask_layers.follow(scene)
    for file in files.values():
        file.unlink(missing_ok=True)


def begin_correcting(scene: bpy.types.Scene) -> None:
    """*Correct* was switched on: the photo comes, so that the next stroke counts, and a tool with it. Never raises."""
    try:
        photo.show(scene)
        for area in photo.areas(scene):
            tools.take_up(bpy.context, area)
        correct(scene)
    except (KarfError, OSError) as error:
        print(f"KaRF: {error}")


def leave_photo(scene: bpy.types.Scene) -> None:
    """Where no editor shows the photo to mark any more, the tools are laid down: their next click would bring it back."""
    if not photo.areas(scene):
        tools.lay_down()
        scene.karf.marking.correct = False


def follow(scene: bpy.types.Scene) -> None:
    """Another view was chosen, or *Correct* switched off: the photo and what the engine says of it follow. Never raises."""
    try:
        if photo.follow(scene):
            correct(scene)
    except (KarfError, OSError) as error:
        print(f"KaRF: {error}")
