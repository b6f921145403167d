"""Step 6: what is done to single swatches and to an object's palette."""

import bpy
from bl_operators.presets import AddPresetBase
from bpy.props import IntProperty, StringProperty

from .. import steps
from ..swatches import edits
from .reporting import SwatchStep, reports_errors


class OneSwatch(SwatchStep):
    """Mix-in of operators on one swatch."""

    bl_options = {"REGISTER", "UNDO"}

    object_name: StringProperty(name="Object")
    index: IntProperty(name="Swatch", default=1, min=1, description="From 1", options={"SKIP_SAVE"})


class OneOrAll(SwatchStep):
    """Mix-in of operators on one swatch or on all of an object."""

    bl_options = {"REGISTER", "UNDO"}

    object_name: StringProperty(name="Object")
    index: IntProperty(name="Swatch", default=0, min=0, description="Counted from 1. 0: all", options={"SKIP_SAVE"})


class TwoSwatches(OneSwatch):
    """Mix-in of operators on two swatches."""

    other_name: StringProperty(name="Other Object")
    other_index: IntProperty(name="Other Swatch", default=1, min=1, description="From 1", options={"SKIP_SAVE"})


class KARF_OT_reset_swatch(OneOrAll, bpy.types.Operator):
    """Reset a swatch, or all of an object's swatches, to the learned color and surface. Locked swatches stay"""

    bl_idname = "karf.reset_swatch"
    bl_label = "Reset Swatch"

    @reports_errors
    def execute(self, context):
        edits.reset(context.scene, self.object_name, self.index or None)
        return {"FINISHED"}


class KARF_OT_reset_surface(OneOrAll, bpy.types.Operator):
    """Reset saturation, brightness and gloss of a swatch, or of all of an object's swatches. Locked swatches stay"""

    bl_idname = "karf.reset_surface"
    bl_label = "Reset Surface"

    @reports_errors
    def execute(self, context):
        edits.reset_surface(context.scene, self.object_name, self.index or None)
        return {"FINISHED"}


class KARF_OT_copy_swatch(OneOrAll, bpy.types.Operator):
    """Copy a swatch's color, or all of an object's, to the clipboard as #rrggbb"""

    bl_idname = "karf.copy_swatch"
    bl_label = "Copy"
    bl_options = {"REGISTER"}

    @reports_errors
    def execute(self, context):
        context.window_manager.clipboard = edits.copied(context.scene, self.object_name, self.index or None)
        return {"FINISHED"}


class KARF_OT_paste_swatch(OneOrAll, bpy.types.Operator):
    """Set a swatch, or an object's swatches in order, to the colors in the clipboard. Locked swatches stay"""

    bl_idname = "karf.paste_swatch"
    bl_label = "Paste"

    @reports_errors
    def execute(self, context):
        edits.paste(context.scene, self.object_name, self.index or None, context.window_manager.clipboard)
        return {"FINISHED"}


class KARF_OT_swap_swatches(TwoSwatches, bpy.types.Operator):
    """Exchange the colors of two swatches"""

    bl_idname = "karf.swap_swatches"
    bl_label = "Swap"

    @reports_errors
    def execute(self, context):
        edits.swap(context.scene, (self.object_name, self.index), (self.other_name, self.other_index))
        return {"FINISHED"}


class KARF_OT_link_swatches(TwoSwatches, bpy.types.Operator):
    """Give this swatch the other one's color, and keep both the same from now on"""

    bl_idname = "karf.link_swatches"
    bl_label = "Link"

    @reports_errors
    def execute(self, context):
        steps.link_swatches(context.scene, (self.object_name, self.index), (self.other_name, self.other_index))
        return {"FINISHED"}


class KARF_OT_unlink_swatch(OneSwatch, bpy.types.Operator):
    """Unlink this swatch from the others. Its color stays"""

    bl_idname = "karf.unlink_swatch"
    bl_label = "Unlink"

    @reports_errors
    def execute(self, context):
        steps.unlink_swatch(context.scene, self.object_name, self.index)
        return {"FINISHED"}


class KARF_OT_merge_swatch(OneSwatch, bpy.types.Operator):
    """Merge this swatch into another one of the object, which then changes both. This swatch is hidden"""

    bl_idname = "karf.merge_swatch"
    bl_label = "Merge"

    into: IntProperty(
        name="Into", default=0, min=0, description="Counted from 1. 0: the swatch with the nearest learned color"
    )

    @reports_errors
    def execute(self, context):
        steps.merge_swatch(context.scene, self.object_name, self.index, self.into or None)
        return {"FINISHED"}


class KARF_OT_split_swatch(OneSwatch, bpy.types.Operator):
    """Separate the swatches that were merged into this one. Their colors stay"""

    bl_idname = "karf.split_swatch"
    bl_label = "Split"

    @reports_errors
    def execute(self, context):
        steps.split_swatch(context.scene, self.object_name, self.index)
        return {"FINISHED"}


class KARF_OT_palette_preset(AddPresetBase, bpy.types.Operator):
    """Keep an object's palette as a preset for any object in any file, or remove a preset"""

    bl_idname = "karf.palette_preset"
    bl_label = "Add Palette Preset"

    preset_menu = "KARF_MT_palette_presets"
    preset_subdir = "karf/palettes"
    preset_defines = ["item = bpy.context.karf_object"]
    preset_values = ["item.palette"]


class KARF_OT_apply_palette_preset(bpy.types.Operator):
    """Set the object's swatches in order to this palette. Locked swatches stay"""

    bl_idname = "karf.apply_palette_preset"
    bl_label = "Apply Palette Preset"
    bl_options = {"REGISTER", "UNDO"}  # which Blender's own operator for presets has not

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    menu_idname: StringProperty(options={"SKIP_SAVE"})

    def execute(self, context):
        return bpy.ops.script.execute_preset(filepath=self.filepath, menu_idname=self.menu_idname)
