"""The workspace to work in."""

import bpy

from ..steps import masks
from ..workspace import opening


class KARF_OT_open_workspace(bpy.types.Operator):
    bl_description = (
        "Go to the KaRF workspace: 3D View, Image Editor and timeline, both sidebars at the KaRF tab. "
        "It is added to the file the first time. An imported capture is ready to mark there"
    )

    bl_idname = "karf.open_workspace"
    bl_label = "KaRF Workspace"

    def execute(self, context):
        opening.open_workspace(context.window)
        opening.set_up(masks.begin_marking, masks.fit_photo)
        return {"FINISHED"}
