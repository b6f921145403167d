"""Steps 2, 4 and 5: what the engine learns, and showing a view of it."""

import bpy
from bpy.props import StringProperty

from .. import steps
from ..pictures import editors
from ..swatches import palettes
from ..tasks import runner
from .reporting import EngineStep, ProjectSwatchStep, reports_errors


class KARF_OT_learn_scene(EngineStep, bpy.types.Operator):
    """Learn the scene's geometry from the photos"""

    bl_idname = "karf.learn_scene"
    bl_label = "Learn Scene"

    @reports_errors
    def execute(self, context):
        runner.launch(steps.learn_scene(context.scene))
        return {"FINISHED"}


class MaskStep(EngineStep):
    """Mix-in of operators that need marked objects."""

    @classmethod
    def poll(cls, context):
        if not super().poll(context):
            return False
        if not context.scene.karf.masks:
            cls.poll_message_set("Mark an object first: paint a mask, or choose a folder of masks")
            return False
        return True


class PaletteMaker:
    """Mix-in of operators that replace the palettes: where there are edits, they say what becomes of them."""

    def invoke(self, context, event):
        if not palettes.has_edits(context.scene):
            return self.execute(context)
        message = "Edits follow their object and color; those that find none are kept in the project"
        return context.window_manager.invoke_confirm(self, event, title="Extract anew?", message=message)


class KARF_OT_learn_all(PaletteMaker, MaskStep, bpy.types.Operator):
    bl_description = (
        "Learn the scene, segment the marked objects, extract their palettes, and show the active view: "
        "steps 2, 4 and 5 in a row. Finished steps are kept"
    )

    bl_idname = "karf.learn_all"
    bl_label = "Learn All"

    @reports_errors
    def execute(self, context):
        runner.launch(steps.learn_all(context.scene))
        return {"FINISHED"}


class KARF_OT_segment(MaskStep, bpy.types.Operator):
    """Turn the coarse masks into clean ones in every view"""

    bl_idname = "karf.segment"
    bl_label = "Segment"
    after = "geometry"

    @reports_errors
    def execute(self, context):
        runner.launch(steps.segment(context.scene))
        return {"FINISHED"}


class KARF_OT_extract_palette(PaletteMaker, EngineStep, bpy.types.Operator):
    bl_description = (
        "Find the swatches of every object and their share in each pixel. Edits, locks and keyframes "
        "stay with their object and color. Edits whose color no longer exists are kept in the project's "
        "folder edits"
    )

    bl_idname = "karf.extract_palette"
    bl_label = "Extract Palette"
    after = "segmentation"

    @reports_errors
    def execute(self, context):
        runner.launch(steps.extract_palette(context.scene))
        return {"FINISHED"}


class KARF_OT_learn_splats(EngineStep, bpy.types.Operator):
    """Also learn the scene as Gaussian splats: new cameras then render it sharper and much faster"""

    bl_idname = "karf.learn_splats"
    bl_label = "Learn Splats"
    after = "geometry"

    @reports_errors
    def execute(self, context):
        runner.launch(steps.learn_splats(context.scene))
        return {"FINISHED"}


class KARF_OT_show_view(ProjectSwatchStep, bpy.types.Operator):
    """Show a captured view with the current swatches. The engine prepares it the first time"""

    bl_idname = "karf.show_view"
    bl_label = "Show View"
    bl_options = {"REGISTER", "UNDO"}

    view: StringProperty(name="View", description="Empty: the active view", options={"SKIP_SAVE"})

    @reports_errors
    def execute(self, context):
        task = steps.show_view(context.scene, self.view)
        if task.requests:
            runner.launch(task)
        result = context.scene.karf.result
        if context.area and context.area.type == "IMAGE_EDITOR" and result is not None:
            editors.show(context.area, result)
        return {"FINISHED"}


class KARF_OT_prepare_views(EngineStep, bpy.types.Operator):
    """Prepare all captured views, so that each is shown immediately"""

    bl_idname = "karf.prepare_views"
    bl_label = "Prepare All Views"
    after = "recoloring"

    views: StringProperty(name="Views", default="all", description="all, train, test, or names separated by commas")

    @reports_errors
    def execute(self, context):
        runner.launch(steps.prepare_views(context.scene, self.views))
        return {"FINISHED"}
