"""Step 1: a project that was begun in an unsaved file moves beside it."""

from pathlib import Path

import bpy

from ..engine_api import BadRequest
from ..marking import history, mask_layers
from ..project import moving
from ..swatches import displayed
from ..tasks import queries, runner


def move_project(scene: bpy.types.Scene) -> Path:
    """Move the scene's project out of the extension's own folder, beside the .blend, which is saved.

    Returns:
        The project's new folder.

    Raises:
        KarfError: A job runs, the file was never saved, or a disk cannot be written; nothing is lost.
    """
    if runner.is_running():
        raise BadRequest("A KaRF job is running.", "Wait for it, or cancel it.")
    queries.stop()
    runner.release()
    place = moving.move(scene)
    history.forget()  # it knows files by their old places
    mask_layers.forget()
    displayed.forget(scene)
    return place
