"""The folders in which files appear, in the system's file manager."""

from pathlib import Path

import bpy
from bpy.props import EnumProperty

from .. import progress
from ..engine_api import BadRequest
from ..project import folders
from .reporting import has_project, reports_errors

FOLDER_ITEMS = [
    ("project", "Project", "Everything learned"),
    ("out", "Output", "Folder for rendered pictures"),
    ("frames", "Frames", "Last rendered pictures"),
    ("written", "Written", "Folder of the last written files"),
]


class KARF_OT_open_folder(bpy.types.Operator):
    """Open this folder in the file manager"""

    bl_idname = "karf.open_folder"
    bl_label = "Open Folder"

    folder: EnumProperty(name="Folder", items=FOLDER_ITEMS, options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return has_project(cls, context)

    @reports_errors
    def execute(self, context):
        folder = _place_of(context.scene, self.folder)
        if not folder.is_dir():
            raise BadRequest("{path} does not exist yet.", "Render something first.", path=folder)
        bpy.ops.wm.path_open(filepath=str(folder))
        return {"FINISHED"}


def _place_of(scene: bpy.types.Scene, kind: str) -> Path:
    if kind == "project":
        return folders.project_of(scene).folder
    if kind == "written":
        return Path(progress.state().folder)
    is_rendered = kind == "frames" and scene.karf.frames
    return folders.absolute(scene.karf.frames) if is_rendered else folders.out_folder(scene)
