"""Step 3: the photo to mark and its neighbors, the objects, a mask erased."""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from .. import steps
from ..engine_api import BadRequest
from ..host.words import translate_report
from ..marking import mask_layers, objects, photo, tools
from ..pictures import editors
from ..project import disk
from .reporting import has_project, has_stage, reports_errors


class MarkingStep:
    """Mix-in of operators that need a capture."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return has_project(cls, context)


class ObjectStep(MarkingStep):
    """Mix-in of operators that need an object to mark."""

    @classmethod
    def poll(cls, context):
        if not super().poll(context):
            return False
        if objects.active(context.scene) is None:
            cls.poll_message_set("Add an object first")
            return False
        return True


class KARF_OT_mark(MarkingStep, bpy.types.Operator):
    """Show the active view's photo in the Image Editors and select a tool to mark it: click, box, lasso or brush"""

    bl_idname = "karf.mark"
    bl_label = "Mark in Photo"

    @reports_errors
    def execute(self, context):
        image = steps.show_photo(context.scene)
        if context.area is not None and context.area.type == "IMAGE_EDITOR":
            editors.show(context.area, image)
        disk.refresh()
        shown = photo.areas(context.scene)
        if not shown and not bpy.app.background:
            self.report({"WARNING"}, "Open an Image Editor to mark the photo")
        for area in shown:
            tools.take_up(context, area)
        return {"FINISHED"}


class KARF_OT_go_to_view(MarkingStep, bpy.types.Operator):
    """Make the next or previous view active"""

    bl_idname = "karf.go_to_view"
    bl_label = "Next View"

    by: IntProperty(name="By", default=1, description="1: next view; -1: previous view")
    marked: BoolProperty(name="Marked", description="Only visit views where the object is marked")

    @classmethod
    def description(cls, context, properties):
        which = "next" if properties.by > 0 else "previous"
        return f"Go to the {which} view" + (" in which the object is marked" if properties.marked else "")

    @reports_errors
    def execute(self, context):
        steps.go_to_view(context.scene, self.by, self.marked)
        if context.region is not None and context.area.type == "IMAGE_EDITOR" and context.region.type == "WINDOW":
            editors.show(context.area, steps.show_photo(context.scene))  # by a key of the tools
        return {"FINISHED"}


class KARF_OT_go_to_suggested(MarkingStep, bpy.types.Operator):
    """Go to the view where a mark would help most, according to the last segmentation. Press again for the next best"""

    bl_idname = "karf.go_to_suggested"
    bl_label = "Suggested View"

    @classmethod
    def poll(cls, context):
        return has_project(cls, context) and has_stage(cls, context, "segmentation")

    @reports_errors
    def execute(self, context):
        steps.go_to_suggested(context.scene)
        return {"FINISHED"}


class KARF_OT_erase_mask(ObjectStep, bpy.types.Operator):
    """Erase the object's mask, or its corrections, in the active view"""

    bl_idname = "karf.erase_mask"
    bl_label = "Erase Mask"

    @reports_errors
    def execute(self, context):
        steps.erase_mask(context.scene)
        return {"FINISHED"}


class KARF_OT_set_volume(ObjectStep, bpy.types.Operator):
    """Restrict the object to the inside or the outside of the active mesh or Empty's box, where it is now"""

    bl_idname = "karf.set_volume"
    bl_label = "Volume"

    kind: EnumProperty(
        name="Volume",
        items=[
            ("inside", "Inside", "The object is nowhere else"),
            ("outside", "Outside", "The object is not in it"),
            ("none", "None", "Take all volumes of the object away"),
        ],
    )

    @reports_errors
    def execute(self, context):
        shape = None if self.kind == "none" else context.active_object
        if shape is None and self.kind != "none":
            raise BadRequest("There is no active object.", "Select a mesh or an Empty in the 3D View.")
        count = steps.set_volume(context.scene, shape, self.kind)
        name = objects.active(context.scene).folder
        self.report(
            {"INFO"},
            translate_report("Volumes of {name}: {count}. Segment takes them into account", name=name, count=count),
        )
        return {"FINISHED"}


class KARF_OT_add_object(MarkingStep, bpy.types.Operator):
    """Add an object to mark. Double-click its name to rename it"""

    bl_idname = "karf.add_object"
    bl_label = "Add Object"

    name: StringProperty(name="Name", default=objects.FIRST)

    @reports_errors
    def execute(self, context):
        steps.add_object(context.scene, self.name)
        mask_layers.redraw()
        return {"FINISHED"}


class KARF_OT_remove_object(ObjectStep, bpy.types.Operator):
    """Remove the object with all its masks and corrections. Undo restores them"""

    bl_idname = "karf.remove_object"
    bl_label = "Remove Object"

    def invoke(self, context, event):
        item = objects.active(context.scene)
        count = disk.contents_of(context.scene).masks.get(item.folder, 0)
        if not count:
            return self.execute(context)
        message = f"{count} masks of {item.folder!r} are removed from the disk"
        return context.window_manager.invoke_confirm(self, event, title="Remove the object?", message=message)

    @reports_errors
    def execute(self, context):
        steps.remove_object(context.scene)
        return {"FINISHED"}
