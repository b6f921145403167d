"""Step 7: the scene as Gaussian splats in files of other programs, and in objects that these have imported."""

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from .. import steps
from ..surface import splat_objects
from ..tasks import runner
from .reporting import EngineStep, has_palette, has_project, has_stage, reports_errors

AXES_ITEMS = [
    ("auto", "Automatic", "Imported splats: as in their file. Scenes learned here: as displayed in Blender"),
    ("capture", "As Imported", "World coordinates of the capture"),
    ("blender", "Z Up", "Position and size as displayed in Blender, with the up axis in formats that define it"),
    ("viewers", "Y Down", "As displayed in Blender, rotated as most splat viewers expect a .ply"),
]


class KARF_OT_export_splat(EngineStep, bpy.types.Operator):
    """Write the scene as Gaussian splats with the current swatches: PLY, SPZ, glTF or USD, by file extension"""

    bl_idname = "karf.export_splat"
    bl_label = "Export Splat"
    bl_options = {"REGISTER", "PRESET"}
    after = "splats"

    filepath: StringProperty(subtype="FILE_PATH", default="scene.ply", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default="*.ply;*.spz;*.glb;*.gltf;*.usd;*.usda;*.usdc", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})
    axes: EnumProperty(name="Axes", items=AXES_ITEMS)
    object_name: StringProperty(name="Object", description="Only export this object. Empty: the whole scene")
    solid: BoolProperty(name="Without Background", description="Leave out the shell of distant background")
    attributes: BoolProperty(
        name="Attributes", description="Store each Gaussian's object, probability and palette weights in a .ply"
    )

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.prop(self, "axes")
        self.layout.prop_search(self, "object_name", context.scene.karf, "objects")
        self.layout.prop(self, "solid")
        self.layout.prop(self, "attributes")

    @reports_errors
    def execute(self, context):
        objects = (self.object_name,) if self.object_name else ()
        path = bpy.path.abspath(self.filepath)
        runner.launch(steps.export_splat(context.scene, path, self.axes, objects, self.solid, self.attributes))
        return {"FINISHED"}


class KARF_OT_follow_splat(bpy.types.Operator):
    bl_description = (
        "Color the active object with the swatches, now and whenever they change. It must be Gaussian "
        "splats imported by Blender or 3DGS Render. Press again to keep its current colors"
    )

    bl_idname = "karf.follow_splat"
    bl_label = "Splat Follows Swatches"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if _newly_chosen(context) is not None:
            is_known = has_project(cls, context) and has_stage(cls, context, "splats")
            return is_known and has_palette(cls, context)
        if splat_objects.find(context.scene) is None:
            cls.poll_message_set("Choose Gaussian splats imported by Blender or 3DGS Render")
            return False
        return True

    @reports_errors
    def execute(self, context):
        item = _newly_chosen(context)
        if item is None:
            steps.unfollow_splat(context.scene)
        else:
            steps.follow_splat(context.scene, item)
        return {"FINISHED"}


def _newly_chosen(context) -> bpy.types.Object | None:
    """The active object, where it is splats that do not follow the swatches yet."""
    item = context.object
    return item if splat_objects.is_splat(item) and item != splat_objects.find(context.scene) else None
