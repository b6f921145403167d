"""Steps 2, 4 and 5: learn scene, masks, palettes and splats; prepare views."""

import bpy
from bpy.props import StringProperty

from .. import steps
from ..pictures import editors
from ..swatches import palettes
from .base import GEOMETRY, IDLE, PALETTES, PROJECT, RECOLORING, SEGMENTATION, StepOperator, need

MASKS = need(
    "Mark an object first: paint a mask, or choose a folder of masks", lambda context: context.scene.karf.masks
)


class KARF_OT_learn_scene(StepOperator, bpy.types.Operator):
    """Learn the scene's geometry from the photos"""

    bl_idname = "karf.learn_scene"
    bl_label = "Learn Scene"
    needs = (IDLE, PROJECT)
    scene_step = steps.learn_scene


class PaletteOperator(StepOperator):
    """Mix-in of operators that replace the palettes, after a confirmation if there are edits."""

    def invoke(self, context, event):
        if not palettes.has_edits(context.scene):
            return self.execute(context)
        message = "Edits follow their object and color; those that find none are kept in the project"
        return context.window_manager.invoke_confirm(self, event, title="Extract anew?", message=message)


class KARF_OT_learn_all(PaletteOperator, bpy.types.Operator):
    bl_description = (
        "Learn the scene, segment the marked objects, extract their palettes, and show the active view: "
        "steps 2, 4 and 5 in a row. Finished steps are kept"
    )

    bl_idname = "karf.learn_all"
    bl_label = "Learn All"
    needs = (IDLE, PROJECT, MASKS)
    scene_step = steps.learn_all


class KARF_OT_segment(StepOperator, bpy.types.Operator):
    """Turn the coarse masks into clean ones in every view"""

    bl_idname = "karf.segment"
    bl_label = "Segment"
    needs = (IDLE, PROJECT, GEOMETRY, MASKS)
    scene_step = steps.segment


class KARF_OT_extract_palette(PaletteOperator, bpy.types.Operator):
    bl_description = (
        "Find the swatches of every object and their share in each pixel. Edits, locks and keyframes "
        "stay with their object and color. Edits whose color no longer exists are kept in the project's "
        "folder edits"
    )

    bl_idname = "karf.extract_palette"
    bl_label = "Extract Palette"
    needs = (IDLE, PROJECT, SEGMENTATION)
    scene_step = steps.extract_palette


class KARF_OT_learn_splats(StepOperator, bpy.types.Operator):
    """Also learn the scene as Gaussian splats: new cameras then render it sharper and much faster"""

    bl_idname = "karf.learn_splats"
    bl_label = "Learn Splats"
    needs = (IDLE, PROJECT, GEOMETRY)
    scene_step = steps.learn_splats


class KARF_OT_show_view(StepOperator, bpy.types.Operator):
    """Show a captured view with the current swatches. The engine prepares it the first time"""

    bl_idname = "karf.show_view"
    bl_label = "Show View"
    bl_options = {"REGISTER", "UNDO"}
    needs = (PROJECT, PALETTES)

    view: StringProperty(name="View", description="Empty: the active view", options={"SKIP_SAVE"})

    def step(self, context):
        task = steps.show_view(context.scene, self.view)
        result = context.scene.karf.result
        if context.area and context.area.type == "IMAGE_EDITOR" and result is not None:
            editors.show(context.area, result)
        return task


class KARF_OT_prepare_views(StepOperator, bpy.types.Operator):
    """Prepare all captured views, so that each is shown immediately"""

    bl_idname = "karf.prepare_views"
    bl_label = "Prepare All Views"
    needs = (IDLE, PROJECT, RECOLORING)

    views: StringProperty(name="Views", default="all", description="all, train, test, or names separated by commas")

    def step(self, context):
        return steps.prepare_views(context.scene, self.views)
