"""Step 5: the scene as points and Gaussian splats, in the 3D View and in files."""

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from .. import progress, steps
from ..host.words import translate_report
from ..steps import floaters
from ..surface import scene_object, splat_objects
from .base import IDLE, PALETTES, PROJECT, SPLATS, SaveFileOperator, StepOperator, Undoable, file_filter, is_met, need

SHAPE_ITEMS = [
    ("quads", "Quads", "Small faces, displayed by every mesh viewer"),
    ("points", "Points", "One vertex per point, for point cloud programs"),
]

AXES_ITEMS = [
    ("auto", "Automatic", "Imported splats: as in their file. Scenes learned here: as displayed in Blender"),
    ("capture", "As Imported", "World coordinates of the capture"),
    ("blender", "Z Up", "Position and size as displayed in Blender, with the up axis in formats that define it"),
    ("viewers", "Y Down", "As displayed in Blender, rotated as most splat viewers expect a .ply"),
]

FOLLOWING_SPLATS = need(
    "Choose Gaussian splats imported by Blender or 3DGS Render", lambda context: splat_objects.find(context.scene)
)
DELETE_BOXES = need("Select a delete box first", lambda context: _delete_boxes(context))


class KARF_OT_show_scene(StepOperator, bpy.types.Operator):
    """Show the learned scene as an object whose colors follow the swatches. Replaces the existing one"""

    bl_idname = "karf.show_scene"
    bl_label = "Show in 3D View"
    needs = (IDLE, PROJECT, PALETTES)
    scene_step = steps.show_scene


class KARF_OT_show_colors(StepOperator, bpy.types.Operator):
    """Show true colors in the 3D Views: Solid mode, flat light, color attributes"""

    bl_idname = "karf.show_colors"
    bl_label = "Flat Colors"

    def step(self, context):
        scene_object.show_colors(area.spaces.active for area in context.screen.areas if area.type == "VIEW_3D")


class KARF_OT_export_scene(SaveFileOperator, bpy.types.Operator):
    """Write the scene in 3D with its current colors: PLY, glTF (.glb, .gltf) or USD, by file extension"""

    bl_idname = "karf.export_scene"
    bl_label = "Export Scene"
    needs = (need("Show the scene in the 3D View first", lambda context: scene_object.find(context.scene)),)

    filepath: StringProperty(subtype="FILE_PATH", default="scene.ply")
    filter_glob: file_filter("*.ply;*.glb;*.gltf;*.usd;*.usda;*.usdc")
    shape: EnumProperty(name="Shape", items=SHAPE_ITEMS)

    def step(self, context):
        path = steps.export_scene(context.scene, self.path, self.shape)
        progress.wrote(path.parent)
        return translate_report("Wrote {path}", path=path)


class KARF_OT_export_splat(SaveFileOperator, bpy.types.Operator):
    """Write the scene as Gaussian splats with the current swatches: PLY, SPZ, SOG, glTF or USD, by file extension"""

    bl_idname = "karf.export_splat"
    bl_label = "Export Splat"
    bl_options = {"REGISTER", "PRESET"}
    needs = (IDLE, PROJECT, SPLATS)

    filepath: StringProperty(subtype="FILE_PATH", default="scene.ply", options={"SKIP_SAVE"})
    filter_glob: file_filter("*.ply;*.spz;*.sog;*.glb;*.gltf;*.usd;*.usda;*.usdc")
    axes: EnumProperty(name="Axes", items=AXES_ITEMS)
    object_name: StringProperty(name="Object", description="Only export this object. Empty: the whole scene")
    solid: BoolProperty(name="Without Background", description="Leave out the shell of distant background")
    attributes: BoolProperty(
        name="Attributes", description="Store each Gaussian's object, probability and palette weights in a .ply"
    )

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.prop(self, "axes")
        self.layout.prop_search(self, "object_name", context.scene.karf, "objects")
        self.layout.prop(self, "solid")
        self.layout.prop(self, "attributes")

    def step(self, context):
        objects = (self.object_name,) if self.object_name else ()
        return steps.export_splat(context.scene, self.path, self.axes, objects, self.solid, self.attributes)


class KARF_OT_add_delete_box(Undoable, bpy.types.Operator):
    """Add a box to move over stray splats, at the point that this 3D View turns about, or at the 3D cursor"""

    bl_idname = "karf.add_delete_box"
    bl_label = "Add Delete Box"
    needs = (PROJECT, SPLATS)

    def step(self, context):
        view = getattr(context, "region_data", None)
        steps.add_delete_box(context.scene, view and view.view_location)


class KARF_OT_delete_inside(StepOperator, bpy.types.Operator):
    """Delete the splats in the selected delete boxes from all pictures and exports, and the boxes"""

    bl_idname = "karf.delete_inside"
    bl_label = "Delete Inside"
    needs = (IDLE, PROJECT, SPLATS, DELETE_BOXES)

    def step(self, context):
        return steps.delete_inside(context.scene, _delete_boxes(context))


class KARF_OT_restore_splats(StepOperator, bpy.types.Operator):
    """Bring back all deleted splats"""

    bl_idname = "karf.restore_splats"
    bl_label = "Restore All"
    needs = (IDLE, PROJECT, SPLATS)
    scene_step = steps.restore_splats


class KARF_OT_follow_splat(Undoable, bpy.types.Operator):
    bl_description = (
        "Color the active object with the swatches, now and whenever they change. It must be Gaussian "
        "splats imported by Blender or 3DGS Render. Press again to keep its current colors"
    )
    bl_idname = "karf.follow_splat"
    bl_label = "Splat Follows Swatches"

    @classmethod
    def poll(cls, context):
        if _newly_chosen(context) is not None:
            return is_met(cls, context, PROJECT, SPLATS, PALETTES)
        return is_met(cls, context, FOLLOWING_SPLATS)

    def step(self, context):
        item = _newly_chosen(context)
        if item is None:
            steps.unfollow_splat(context.scene)
        else:
            steps.follow_splat(context.scene, item)


def _delete_boxes(context) -> list[bpy.types.Object]:
    return [item for item in context.selected_objects if floaters.is_delete_box(item)]


def _newly_chosen(context) -> bpy.types.Object | None:
    """Return the active object if its splats can follow the swatches and do not yet."""
    item = context.object
    return item if splat_objects.is_splat(item) and item != splat_objects.find(context.scene) else None
