"""Step 7: the learned scene in the 3D View, and as a file of other programs."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from .. import progress, steps
from ..host.words import translate_report
from ..surface import scene_object
from ..tasks import runner
from .reporting import PaletteStep, reports_errors

SHAPE_ITEMS = [
    ("quads", "Quads", "Small faces, displayed by every mesh viewer"),
    ("points", "Points", "One vertex per point, for point cloud programs"),
]


class KARF_OT_show_scene(PaletteStep, bpy.types.Operator):
    """Show the learned scene as an object whose colors follow the swatches. Replaces the existing one"""

    bl_idname = "karf.show_scene"
    bl_label = "Show in 3D View"

    @reports_errors
    def execute(self, context):
        runner.launch(steps.show_scene(context.scene))
        return {"FINISHED"}


class KARF_OT_show_colors(bpy.types.Operator):
    """Show true colors in the 3D Views: Solid mode, flat light, color attributes"""

    bl_idname = "karf.show_colors"
    bl_label = "Flat Colors"

    def execute(self, context):
        areas = [area for area in context.screen.areas if area.type == "VIEW_3D"]
        scene_object.show_colors(area.spaces.active for area in areas)
        return {"FINISHED"}


class KARF_OT_export_scene(bpy.types.Operator):
    """Write the scene in 3D with its current colors: PLY, glTF (.glb, .gltf) or USD, by file extension"""

    bl_idname = "karf.export_scene"
    bl_label = "Export Scene"

    filepath: StringProperty(subtype="FILE_PATH", default="scene.ply")
    filter_glob: StringProperty(default="*.ply;*.glb;*.gltf;*.usd;*.usda;*.usdc", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})
    shape: EnumProperty(name="Shape", items=SHAPE_ITEMS)

    @classmethod
    def poll(cls, context):
        if scene_object.find(context.scene) is None:
            cls.poll_message_set("Show the scene in the 3D View first")
            return False
        return True

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @reports_errors
    def execute(self, context):
        path = steps.export_scene(context.scene, Path(bpy.path.abspath(self.filepath)), self.shape)
        progress.wrote(path.parent)
        self.report({"INFO"}, translate_report("Wrote {path}", path=path))
        return {"FINISHED"}
