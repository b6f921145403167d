"""Looks and colorways: keep, choose and render variants of the swatches."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from .. import steps
from ..host.words import translatable, translate, translate_report
from ..pictures import tints
from ..swatches import colors, looks, overlays
from ..tasks import runner
from .base import (
    IDLE,
    PALETTES,
    PROJECT,
    SPLATS,
    OpenFileOperator,
    StepOperator,
    Undoable,
    file_filter,
    need,
    reports_errors,
)
from .render import draw_output

WHAT_ITEMS = [
    ("CAPTURE", "Captured Views", "Recolor each photo with every look"),
    ("CAMERA", "Camera's Frames", "Render the scene's camera at every frame with every look"),
]

WIDTH, ROWS = 720, 14  # of the dialog of colorways: pixels, and colors shown without scrolling


class LookOperator(Undoable):
    """Mix-in of operators on one look."""

    needs = (PALETTES,)

    name: StringProperty(name="Look", options={"SKIP_SAVE"})


class KARF_OT_keep_look(LookOperator, bpy.types.Operator):
    """Keep the current swatches as a look of this file, or replace a look. A click brings them back"""

    bl_idname = "karf.keep_look"
    bl_label = "Keep Look"

    def step(self, context):
        name = steps.keep_look(context.scene, self.name)
        return translate_report("The swatches are kept as look {name}", name=name)


class KARF_OT_choose_look(LookOperator, bpy.types.Operator):
    """Set all swatches to this look, including locked ones"""

    bl_idname = "karf.choose_look"
    bl_label = "Choose Look"

    def step(self, context):
        remark = _unsaved_changes_warning(context.scene)
        steps.choose_look(context.scene, self.name)
        return remark


class KARF_OT_flip_looks(Undoable, bpy.types.Operator):
    """Switch between this look and the one used before"""

    bl_idname = "karf.flip_looks"
    bl_label = "Flip Looks"
    needs = (PALETTES, need("Keep two looks to switch between them", lambda context: looks.other(context.scene)))

    def invoke(self, context, event):
        is_key = context.region is not None and context.region.type == "WINDOW"  # the button is in a sidebar
        if is_key and not overlays.shows_picture(context):
            return {"PASS_THROUGH"}  # over another picture keys keep their own meaning
        return self.execute(context)

    def step(self, context):
        remark = _unsaved_changes_warning(context.scene)
        name = steps.flip_looks(context.scene)
        return remark or name


def _unsaved_changes_warning(scene):
    """Return a sentence if the swatches have unsaved changes, which undo brings back."""
    if not looks.is_changed(scene):
        return ""
    return translate_report("{name} had changed since you kept it: undo restores the changes", name=scene.karf.look)


class KARF_OT_rename_look(LookOperator, bpy.types.Operator):
    """Rename this look"""

    bl_idname = "karf.rename_look"
    bl_label = "Rename Look"

    new: StringProperty(name="Name", options={"SKIP_SAVE"})

    def invoke(self, context, event):
        self.new = self.name
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, context):
        self.layout.prop(self, "new")

    def step(self, context):
        steps.rename_look(context.scene, self.name, self.new)


class KARF_OT_remove_look(LookOperator, bpy.types.Operator):
    """Remove this look. The swatches stay as they are"""

    bl_idname = "karf.remove_look"
    bl_label = "Remove Look"

    def step(self, context):
        steps.remove_look(context.scene, self.name)


class KARF_OT_move_look(LookOperator, bpy.types.Operator):
    """Move this look in the list"""

    bl_idname = "karf.move_look"
    bl_label = "Move Look"

    by: IntProperty(name="By", default=1, description="Number of places down the list", options={"SKIP_SAVE"})

    def step(self, context):
        steps.move_look(context.scene, self.name, self.by)


class VariantsOperator(StepOperator):
    """Mix-in of operators that recolor views in several ways."""

    views: StringProperty(
        name="Views",
        default="all",
        description="all, train, test, names and ranges (0000-0007) separated by commas, or the path of a camera file",
    )


class KARF_OT_render_looks(VariantsOperator, bpy.types.Operator):
    """Recolor views with each look, in a folder of its name"""

    bl_idname = "karf.render_looks"
    bl_label = "Render Looks"
    needs = (IDLE, PROJECT, PALETTES, need("Keep a look first", lambda context: context.scene.karf.looks))

    what: EnumProperty(name="Render", items=WHAT_ITEMS)

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.label(text=", ".join(context.scene.karf.looks.keys()), translate=False)
        layout.prop(self, "what")
        if self.what == "CAPTURE":
            layout.prop(self, "views")
        else:
            layout.prop(context.scene, "camera")
        draw_output(layout.column(), context.scene.karf)

    def step(self, context):
        of_camera = self.what == "CAMERA"
        runner.launch(steps.render_looks(context.scene, self.views, of_camera))
        return translate_report("Pictures will be in {path}", path=steps.looks_folder(context.scene, of_camera))


class KARF_OT_export_page(StepOperator, bpy.types.Operator):
    """Write a web page on which clients turn the scene, switch its looks and drag swatches that are not locked"""

    bl_idname = "karf.export_page"
    bl_label = "Export Page"
    bl_options = {"REGISTER", "PRESET"}
    needs = (IDLE, PROJECT, SPLATS)

    directory: StringProperty(
        name="Folder",
        subtype="DIR_PATH",
        description="New or empty folder, or one with an earlier page. Default: in the output folder",
    )
    title: StringProperty(name="Title", description="Default: the name of the scene")
    studio: StringProperty(name="Studio", description="Who made it")
    logo: StringProperty(name="Logo", subtype="FILE_PATH", description="PNG, JPEG, WebP or SVG")
    single: BoolProperty(name="Single File", description="Put all into index.html, which opens by a double click")

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, context):
        self.layout.use_property_split = True
        for name in ("directory", "title", "studio", "logo", "single"):
            self.layout.prop(self, name)

    def step(self, context):
        out, logo = (bpy.path.abspath(path) for path in (self.directory, self.logo))
        return steps.export_page(context.scene, out, self.title, self.studio, logo, self.single)


class KARF_UL_colorways(bpy.types.UIList):
    """Colors of a sheet: wanted, what it will be, and why not closer."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        draw_color(layout, item)


def draw_color(layout, item):
    """Draw names, chips of the wanted and the predicted color, their difference, and the reason."""
    both = layout.split(factor=0.35)
    names, rest = both.row(), both.row().split(factor=0.25)
    names.label(text=item.colorway)
    names.label(text=item.object)
    numbers, reason = rest.row(), rest.row()
    numbers.label(text="", icon_value=tints.icon(item.wanted))
    numbers.label(text=f"{item.difference:.1f}", icon_value=tints.icon(item.reached))
    if item.reason:
        reason.label(text=item.reason, icon="ERROR")


class KARF_OT_colorways(OpenFileOperator, bpy.types.Operator):
    """Choose a sheet of colorways (CSV or JSON), preview its colors, and recolor all views with each colorway"""

    bl_idname = "karf.colorways"
    bl_label = "Colorways"
    needs = (IDLE, PROJECT, PALETTES)

    filter_glob: file_filter("*.csv;*.json")

    @reports_errors
    def execute(self, context):
        show_predictions(context, self.path)
        return bpy.ops.karf.render_colorways("INVOKE_DEFAULT", filepath=self.filepath)


class KARF_OT_render_colorways(VariantsOperator, bpy.types.Operator):
    """Recolor views with each colorway of a sheet"""

    bl_idname = "karf.render_colorways"
    bl_label = "Render Colorways"
    needs = (IDLE, PROJECT, PALETTES)

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE", "HIDDEN"})

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self, width=WIDTH)

    def draw(self, context):
        shown, layout = context.window_manager.karf_colorways, self.layout
        sentence = translatable(
            "{count} colors, {missed} out of reach. Numbers: difference from the wanted color; 1 is just visible"
        )
        missed = sum(bool(item.reason) for item in shown.colors)
        layout.label(text=translate(sentence, count=len(shown.colors), missed=missed))
        rows = min(ROWS, len(shown.colors))
        layout.template_list(KARF_UL_colorways.__name__, "", shown, "colors", shown, "active", rows=rows)
        if shown.active < len(shown.colors) and (reason := shown.colors[shown.active].reason):
            layout.label(text=translate("Out of reach: {reason}", reason=reason), icon="ERROR")
        layout.prop(self, "views")

    def step(self, context):
        sheet = Path(bpy.path.abspath(self.filepath))
        runner.launch(steps.colorways(context.scene, sheet, self.views))
        return translate_report("Pictures will be in {path}", path=steps.colorways_folder(context.scene, sheet))


def show_predictions(context, sheet):
    """Fill the list with the predicted colors of a sheet. Raises KarfError if the sheet is wrong."""
    planned = steps.predict_colorways(context.scene, sheet)
    shown = context.window_manager.karf_colorways
    shown.colors.clear()
    for plan in planned:
        for prediction in (each.under_light(colors.reference_light(context.scene)) for each in plan.predictions):
            item = shown.colors.add()
            item.colorway, item.object = plan.colorway.name, prediction.target_color.name
            item.wanted, item.reached = prediction.target, prediction.reached
            item.difference, item.reason = prediction.ciede2000, prediction.reason
    shown.active = next((number for number, item in enumerate(shown.colors) if item.reason), 0)
