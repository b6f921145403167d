"""Step 6: named looks, kept, chosen, flipped. Step 7: rendered, a folder for each."""

import bpy
from bpy.props import EnumProperty, IntProperty, StringProperty

from .. import steps
from ..host import windows
from ..host.words import translate_report
from ..swatches import drawn_over, looks
from ..tasks import runner
from .reporting import PaletteStep, SwatchStep, reports_errors

WHAT_ITEMS = [
    ("CAPTURE", "Captured Views", "Recolor each photo with every look"),
    ("CAMERA", "Camera's Frames", "Render the scene's camera at every frame with every look"),
]


class LookStep(SwatchStep):
    """Mix-in of operators on looks: `act` does what they do, and returns what there is to say."""

    bl_options = {"REGISTER", "UNDO"}

    @reports_errors
    def execute(self, context):
        sentence = self.act(context.scene)
        windows.redraw_sidebars()  # those of other editors too
        if sentence:
            self.report({"INFO"}, sentence)
        return {"FINISHED"}


class OneLook(LookStep):
    """Mix-in of operators on one look."""

    name: StringProperty(name="Look", options={"SKIP_SAVE"})


class KARF_OT_keep_look(OneLook, bpy.types.Operator):
    """Keep the current swatches as a look of this file, or replace a look. A click brings them back"""

    bl_idname = "karf.keep_look"
    bl_label = "Keep Look"

    def act(self, scene):
        name = steps.keep_look(scene, self.name)
        return translate_report("The swatches are kept as look {name}", name=name)


class KARF_OT_choose_look(OneLook, bpy.types.Operator):
    """Set all swatches to this look, including locked ones"""

    bl_idname = "karf.choose_look"
    bl_label = "Choose Look"

    def act(self, scene):
        remark = what_is_left_behind(scene)
        steps.choose_look(scene, self.name)
        return remark


class KARF_OT_flip_looks(LookStep, bpy.types.Operator):
    """Switch between this look and the one used before"""

    bl_idname = "karf.flip_looks"
    bl_label = "Flip Looks"

    @classmethod
    def poll(cls, context):
        if not super().poll(context):
            return False
        if not looks.other(context.scene):
            cls.poll_message_set("Keep two looks to switch between them")
            return False
        return True

    def invoke(self, context, event):
        is_key = context.region is not None and context.region.type == "WINDOW"  # the button is in a sidebar
        if is_key and not drawn_over.shows_picture(context):
            return {"PASS_THROUGH"}  # over another picture keys keep their own meaning
        return self.execute(context)

    def act(self, scene):
        remark = what_is_left_behind(scene)
        name = steps.flip_looks(scene)
        return remark or name


def what_is_left_behind(scene):
    """A sentence where the swatches were not kept as they stand; undo brings them back."""
    if not looks.is_changed(scene):
        return ""
    return translate_report("{name} had changed since you kept it: undo restores the changes", name=scene.karf.look)


class KARF_OT_rename_look(OneLook, bpy.types.Operator):
    """Rename this look"""

    bl_idname = "karf.rename_look"
    bl_label = "Rename Look"

    new: StringProperty(name="Name", options={"SKIP_SAVE"})

    def invoke(self, context, event):
        self.new = self.name
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, context):
        self.layout.prop(self, "new")

    def act(self, scene):
        steps.rename_look(scene, self.name, self.new)


class KARF_OT_remove_look(OneLook, bpy.types.Operator):
    """Remove this look. The swatches stay as they are"""

    bl_idname = "karf.remove_look"
    bl_label = "Remove Look"

    def act(self, scene):
        steps.remove_look(scene, self.name)


class KARF_OT_move_look(OneLook, bpy.types.Operator):
    """Move this look in the list"""

    bl_idname = "karf.move_look"
    bl_label = "Move Look"

    by: IntProperty(name="By", default=1, description="Number of places down the list", options={"SKIP_SAVE"})

    def act(self, scene):
        steps.move_look(scene, self.name, self.by)


class KARF_OT_render_looks(PaletteStep, bpy.types.Operator):
    """Recolor views with each look, in a folder of its name"""

    bl_idname = "karf.render_looks"
    bl_label = "Render Looks"

    what: EnumProperty(name="Render", items=WHAT_ITEMS)
    views: StringProperty(
        name="Views",
        default="all",
        description="all, train, test, names separated by commas, or the path of a camera file",
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
            {"INFO"}, translate_report("Pictures will be in {path}", path=steps.looks_folder(context.scene, of_camera))
        )
        return {"FINISHED"}
