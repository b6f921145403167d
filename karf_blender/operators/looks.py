"""Step 6: named looks, kept, chosen, flipped. Step 7: rendered, a folder for each."""

import bpy
from bpy.props import EnumProperty, IntProperty, StringProperty

from .. import steps
from ..host.words import translate_report
from ..swatches import drawn_over, looks
from ..tasks import runner
from .reporting import PaletteStep, SwatchStep, reports_errors

WHAT_ITEMS = [
    ("CAPTURE", "Captured Views", "The photos, each recolored by every look"),
    ("CAMERA", "Camera's Frames", "What the scene's camera sees in the scene's frames, by every look"),
]


class OneLook(SwatchStep):
    """Mix-in of operators on one look."""

    bl_options = {"REGISTER", "UNDO"}

    name: StringProperty(name="Look", options={"SKIP_SAVE"})


class KARF_OT_keep_look(OneLook, bpy.types.Operator):
    """Keep all swatches as they stand as a look of this file, or in the place of one, to come back to them by a click"""

    bl_idname = "karf.keep_look"
    bl_label = "Keep Look"

    @reports_errors
    def execute(self, context):
        name = steps.keep_look(context.scene, self.name)
        self.report({"INFO"}, translate_report("The swatches are kept as look {name}", name=name))
        return {"FINISHED"}


class KARF_OT_choose_look(OneLook, bpy.types.Operator):
    """Set all swatches to this look, locked ones too"""

    bl_idname = "karf.choose_look"
    bl_label = "Choose Look"

    @reports_errors
    def execute(self, context):
        warn_of_change(self, context)
        steps.choose_look(context.scene, self.name)
        return {"FINISHED"}


class KARF_OT_flip_looks(SwatchStep, bpy.types.Operator):
    """Flip back to the look that was in use before, and forth again"""

    bl_idname = "karf.flip_looks"
    bl_label = "Flip Looks"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if not super().poll(context):
            return False
        if not looks.other(context.scene):
            cls.poll_message_set("Keep two looks to flip between them")
            return False
        return True

    def invoke(self, context, event):
        is_key = context.region is not None and context.region.type == "WINDOW"  # the button is in a sidebar
        if is_key and not drawn_over.shows_picture(context):
            return {"PASS_THROUGH"}  # over another picture keys keep their own meaning
        return self.execute(context)

    @reports_errors
    def execute(self, context):
        warn_of_change(self, context)
        name = steps.flip_looks(context.scene)
        if not looks.is_changed(context.scene):
            self.report({"INFO"}, name)
        return {"FINISHED"}


def warn_of_change(operator, context):
    """Say that the swatches were not kept as they stand; undo brings them back."""
    if looks.is_changed(context.scene):
        operator.report(
            {"INFO"},
            translate_report(
                "{name} had changed since it was kept: undo brings that back", name=context.scene.karf.look
            ),
        )


class KARF_OT_rename_look(OneLook, bpy.types.Operator):
    """Give this look another name"""

    bl_idname = "karf.rename_look"
    bl_label = "Rename Look"

    new: StringProperty(name="Name", options={"SKIP_SAVE"})

    def invoke(self, context, event):
        self.new = self.name
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, context):
        self.layout.prop(self, "new")

    @reports_errors
    def execute(self, context):
        steps.rename_look(context.scene, self.name, self.new)
        return {"FINISHED"}


class KARF_OT_remove_look(OneLook, bpy.types.Operator):
    """Remove this look; swatches stay as they are"""

    bl_idname = "karf.remove_look"
    bl_label = "Remove Look"

    @reports_errors
    def execute(self, context):
        steps.remove_look(context.scene, self.name)
        return {"FINISHED"}


class KARF_OT_move_look(OneLook, bpy.types.Operator):
    """Move this look in the list"""

    bl_idname = "karf.move_look"
    bl_label = "Move Look"

    by: IntProperty(name="By", default=1, description="Places down the list", options={"SKIP_SAVE"})

    @reports_errors
    def execute(self, context):
        steps.move_look(context.scene, self.name, self.by)
        return {"FINISHED"}


class KARF_OT_render_looks(PaletteStep, bpy.types.Operator):
    """Recolor views by each look that was kept, a folder for each"""

    bl_idname = "karf.render_looks"
    bl_label = "Render Looks"

    what: EnumProperty(name="Render", items=WHAT_ITEMS)
    views: StringProperty(
        name="Views", default="all", description="all, train, test, names with commas, or the path of a camera file"
    )

    @classmethod
    def poll(cls, context):
        if not super().poll(context):
            return False
        if not len(context.scene.karf.looks):
            cls.poll_message_set("Keep a look first")
            return False
        return True

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.label(text=", ".join(context.scene.karf.looks.keys()), translate=False)
        layout.prop(self, "what")
        if self.what == "CAPTURE":
            layout.prop(self, "views")
        else:
            layout.prop(context.scene, "camera")

    @reports_errors
    def execute(self, context):
        of_camera = self.what == "CAMERA"
        runner.launch(steps.render_looks(context.scene, self.views, of_camera))
        self.report(
            {"INFO"}, translate_report("Pictures go to {path}", path=steps.looks_folder(context.scene, of_camera))
        )
        return {"FINISHED"}


CLASSES = (
    KARF_OT_keep_look,
    KARF_OT_choose_look,
    KARF_OT_flip_looks,
    KARF_OT_rename_look,
    KARF_OT_remove_look,
    KARF_OT_move_look,
    KARF_OT_render_looks,
)
