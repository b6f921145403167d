"""Step 7: the scene rendered by Blender's own ways."""

import bpy

from .. import steps
from ..project import disk
from .reporting import reports_errors


class LearnedStep:
    """Mix-in of operators that need the learned scene."""

    @classmethod
    def poll(cls, context):
        if "geometry" in disk.contents_of(context.scene).stages:
            return True
        cls.poll_message_set("Learn the scene first")
        return False


class KARF_OT_rendered_view(LearnedStep, bpy.types.Operator):
    """Show the recolored scene from any angle in the 3D Views, and render it with F12: render engine KaRF"""

    bl_idname = "karf.rendered_view"
    bl_label = "Rendered View"

    @reports_errors
    def execute(self, context):
        areas = context.screen.areas if context.screen else ()
        steps.use_engine(context.scene, [area.spaces.active for area in areas if area.type == "VIEW_3D"])
        return {"FINISHED"}


class KARF_OT_over_scene(LearnedStep, bpy.types.Operator):
    """Composite this file's objects into renders of the captured scene, with correct occlusion"""

    bl_idname = "karf.over_scene"
    bl_label = "Over Scene"
    bl_options = {"REGISTER", "UNDO"}

    @reports_errors
    def execute(self, context):
        steps.put_objects_in(context.scene)
        return {"FINISHED"}
