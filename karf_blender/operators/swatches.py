"""Step 4: swatches, palettes and edits."""

from collections.abc import Callable
from pathlib import Path

import bpy
from bl_operators.presets import AddPresetBase
from bpy.props import IntProperty, StringProperty

from .. import steps
from ..engine_api import EDIT_SUFFIXES
from ..host.words import translatable, translate_report
from ..swatches import edits
from .base import PALETTES, PREPARED, PROJECT, OpenFileOperator, SaveFileOperator, Undoable, file_filter


class OneSwatch(Undoable):
    """Mix-in of operators on one swatch."""

    needs = (PALETTES,)

    object_name: StringProperty(name="Object")
    index: IntProperty(name="Swatch", default=1, min=1, description="From 1", options={"SKIP_SAVE"})
    swatch_step: Callable  # in place of a method `step`: called with the scene, the object and the swatch, None: all

    def step(self, context):
        return type(self).swatch_step(context.scene, self.object_name, self.index or None)


class OneOrAll(OneSwatch):
    """Mix-in of operators on one swatch or on all of an object."""

    index: IntProperty(name="Swatch", default=0, min=0, description="Counted from 1. 0: all", options={"SKIP_SAVE"})


class TwoSwatches(OneSwatch):
    """Mix-in of operators on two swatches."""

    other_name: StringProperty(name="Other Object")
    other_index: IntProperty(name="Other Swatch", default=1, min=1, description="From 1", options={"SKIP_SAVE"})


class KARF_OT_reset_swatch(OneOrAll, bpy.types.Operator):
    """Reset a swatch, or all of an object's swatches, to the learned color and surface. Locked swatches stay"""

    bl_idname = "karf.reset_swatch"
    bl_label = "Reset Swatch"
    swatch_step = edits.reset


class KARF_OT_reset_surface(OneOrAll, bpy.types.Operator):
    """Reset saturation, brightness and gloss of a swatch, or of all of an object's swatches. Locked swatches stay"""

    bl_idname = "karf.reset_surface"
    bl_label = "Reset Surface"
    swatch_step = edits.reset_surface


class KARF_OT_copy_swatch(OneOrAll, bpy.types.Operator):
    """Copy a swatch's color, or all of an object's, to the clipboard as #rrggbb"""

    bl_idname = "karf.copy_swatch"
    bl_label = "Copy"
    bl_options = {"REGISTER"}

    def step(self, context):
        context.window_manager.clipboard = edits.copied(context.scene, self.object_name, self.index or None)


class KARF_OT_paste_swatch(OneOrAll, bpy.types.Operator):
    """Set a swatch, or an object's swatches in order, to the colors in the clipboard. Locked swatches stay"""

    bl_idname = "karf.paste_swatch"
    bl_label = "Paste"

    def step(self, context):
        edits.paste(context.scene, self.object_name, self.index or None, context.window_manager.clipboard)


class KARF_OT_swap_swatches(TwoSwatches, bpy.types.Operator):
    """Exchange the colors of two swatches"""

    bl_idname = "karf.swap_swatches"
    bl_label = "Swap"

    def step(self, context):
        edits.swap(context.scene, (self.object_name, self.index), (self.other_name, self.other_index))


class KARF_OT_link_swatches(TwoSwatches, bpy.types.Operator):
    """Give this swatch the other one's color, and keep both the same from now on"""

    bl_idname = "karf.link_swatches"
    bl_label = "Link"

    def step(self, context):
        steps.link_swatches(context.scene, (self.object_name, self.index), (self.other_name, self.other_index))


class KARF_OT_unlink_swatch(OneSwatch, bpy.types.Operator):
    """Unlink this swatch from the others. Its color stays"""

    bl_idname = "karf.unlink_swatch"
    bl_label = "Unlink"
    swatch_step = steps.unlink_swatch


class KARF_OT_merge_swatch(OneSwatch, bpy.types.Operator):
    """Merge this swatch into another one of the object, which then changes both. This swatch is hidden"""

    bl_idname = "karf.merge_swatch"
    bl_label = "Merge"

    into: IntProperty(
        name="Into", default=0, min=0, description="Counted from 1. 0: the swatch with the nearest learned color"
    )

    def step(self, context):
        steps.merge_swatch(context.scene, self.object_name, self.index, self.into or None)


class KARF_OT_split_swatch(OneSwatch, bpy.types.Operator):
    """Separate the swatches that were merged into this one. Their colors stay"""

    bl_idname = "karf.split_swatch"
    bl_label = "Split"
    swatch_step = steps.split_swatch


class KARF_OT_remove_color(OneSwatch, bpy.types.Operator):
    """Remove this added color. Its pigment follows the other swatches again"""

    bl_idname = "karf.remove_color"
    bl_label = "Remove"
    swatch_step = steps.remove_color


class KARF_OT_palette_preset(AddPresetBase, bpy.types.Operator):
    """Keep an object's palette as a preset for any object in any file, or remove a preset"""

    bl_idname = "karf.palette_preset"
    bl_label = "Add Palette Preset"

    preset_menu = "KARF_MT_palette_presets"
    preset_subdir = "karf/palettes"
    preset_defines = ["item = bpy.context.karf_object"]
    preset_values = ["item.palette"]


class KARF_OT_apply_palette_preset(Undoable, bpy.types.Operator):
    """Set the object's swatches in order to this palette. Locked swatches stay"""

    bl_idname = "karf.apply_palette_preset"
    bl_label = "Apply Palette Preset"

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    menu_idname: StringProperty(options={"SKIP_SAVE"})

    def execute(self, context):
        return bpy.ops.script.execute_preset(filepath=self.filepath, menu_idname=self.menu_idname)


class KARF_OT_becomes(Undoable, bpy.types.Operator):
    """Set the object's swatches so that the source color becomes the target color. Locked swatches stay"""

    bl_idname = "karf.becomes"
    bl_label = "Becomes"
    needs = (PROJECT, PALETTES)

    object_name: StringProperty(name="Object")

    def step(self, context):
        remark = edits.become_target(edits.object_named(context.scene, self.object_name))
        if remark:
            self.report({"WARNING"}, remark)


class KARF_OT_paint_over(Undoable, bpy.types.Operator):
    """Paint on a copy of the active view in the Image Editor, then match the swatches to it"""

    bl_idname = "karf.paint_over"
    bl_label = "Paint Over"
    needs = (PROJECT, PALETTES, PREPARED)

    def step(self, context):
        steps.paint_over(context.scene)
        return translatable("Paint on the objects in the Image Editor, then press Match Picture")


class KARF_OT_match_picture(Undoable, bpy.types.Operator):
    """Set the swatches so that the active view matches this edited picture of it. Locked swatches stay"""

    bl_idname = "karf.match_picture"
    bl_label = "Match Picture"
    needs = (PROJECT, PALETTES, PREPARED)

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})

    def step(self, context):
        file = Path(bpy.path.abspath(self.filepath)) if self.filepath else None
        found = steps.match_picture(context.scene, file)
        left = ", ".join(f"{each.name} {each.before:.1f} before, {each.after:.1f} now" for each in found)
        return translate_report("Remaining difference from the picture: {left}", left=left)


class KARF_OT_load_edit(OpenFileOperator, bpy.types.Operator):
    """Set the swatches from an edit file, or from a palette of GIMP (.gpl) or Adobe (.ase)"""

    bl_idname = "karf.load_edit"
    bl_label = "Load Edit"
    bl_options = {"REGISTER", "UNDO"}
    needs = (PALETTES,)

    filter_glob: file_filter(";".join(f"*{suffix}" for suffix in EDIT_SUFFIXES))

    def step(self, context):
        steps.apply_edit(context.scene, self.path)


class KARF_OT_save_edit(SaveFileOperator, bpy.types.Operator):
    """Write the swatches to an edit file for other scenes and scripts, or to a palette (.gpl, .ase)"""

    bl_idname = "karf.save_edit"
    bl_label = "Save Edit"
    needs = (PALETTES,)

    filepath: StringProperty(subtype="FILE_PATH", default="edit.json")
    filter_glob: file_filter(";".join(f"*{suffix}" for suffix in EDIT_SUFFIXES))

    def step(self, context):
        steps.save_edit(context.scene, self.path)
        return translate_report("Wrote {path}", path=self.filepath)


class KARF_FH_edit(bpy.types.FileHandler):
    """Load edit files dropped on the recolored picture"""

    bl_label = "KaRF edit"
    bl_import_operator = KARF_OT_load_edit.bl_idname
    bl_file_extensions = ";".join(EDIT_SUFFIXES)

    @classmethod
    def poll_drop(cls, context):
        return context.area is not None and context.area.type == "IMAGE_EDITOR" and len(context.scene.karf.objects) > 0
