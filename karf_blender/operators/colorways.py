"""Step 7: colorways, with what each color will be before anything is rendered."""

from pathlib import Path

import bpy
from bpy.props import StringProperty

from .. import steps
from ..host.words import translate, translate_report
from ..pictures import chips
from ..swatches import reference
from ..tasks import runner
from .reporting import PaletteStep, reports_errors

WIDTH, ROWS = 720, 14  # of the dialog: width in pixels, and colors that show without scrolling


class KARF_UL_colorways(bpy.types.UIList):
    """Colors of a sheet: wanted, what it will be, and why not closer."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        draw_color(layout, item)


def draw_color(layout, item):
    """A row: names, chips of the wanted and the predicted color, their difference, and the reason."""
    names, rest = split(layout, 0.35)
    names.label(text=item.colorway)
    names.label(text=item.object)
    numbers, reason = split(rest, 0.25)
    numbers.label(text="", icon_value=chips.icon(item.wanted))
    numbers.label(text=f"{item.difference:.1f}", icon_value=chips.icon(item.reached))
    if item.reason:
        reason.label(text=item.reason, icon="ERROR")


def split(layout, factor):
    """Two rows side by side."""
    both = layout.split(factor=factor)
    return both.row(), both.row()


class KARF_OT_colorways(PaletteStep, bpy.types.Operator):
    """Choose a sheet of colorways (CSV or JSON), preview its colors, and recolor all views with each colorway"""

    bl_idname = "karf.colorways"
    bl_label = "Colorways"

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default="*.csv;*.json", options={"HIDDEN"})

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @reports_errors
    def execute(self, context):
        show_predictions(context, Path(bpy.path.abspath(self.filepath)))
        return bpy.ops.karf.render_colorways("INVOKE_DEFAULT", filepath=self.filepath)


class KARF_OT_render_colorways(PaletteStep, bpy.types.Operator):
    """Recolor views with each colorway of a sheet"""

    bl_idname = "karf.render_colorways"
    bl_label = "Render Colorways"

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE", "HIDDEN"})
    views: StringProperty(
        name="Views",
        default="all",
        description="all, train, test, names separated by commas, or the path of a camera file",
    )

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self, width=WIDTH)

    def draw(self, context):
        shown, layout = context.window_manager.karf_colorways, self.layout
        missed = sum(bool(item.reason) for item in shown.colors)
        count = len(shown.colors)
        layout.label(
            text=translate(
                "{count} colors, {missed} out of reach. Numbers: difference from the wanted color; 1 is just visible",
                count=count,
                missed=missed,
            )
        )
        rows = min(ROWS, len(shown.colors))
        layout.template_list(KARF_UL_colorways.__name__, "", shown, "colors", shown, "active", rows=rows)
        if shown.active < len(shown.colors) and (reason := shown.colors[shown.active].reason):
            layout.label(text=translate("Out of reach: {reason}", reason=reason), icon="ERROR")
        layout.prop(self, "views")

    @reports_errors
    def execute(self, context):
        sheet = Path(bpy.path.abspath(self.filepath))
        runner.launch(steps.colorways(context.scene, sheet, self.views))
        self.report(
            {"INFO"}, translate_report("Pictures will be in {path}", path=steps.colorways_folder(context.scene, sheet))
        )
        return {"FINISHED"}


def show_predictions(context, sheet):
    """Fill the list with what each color of a sheet will be. Raises KarfError where the sheet is wrong."""
    planned = steps.predict_colorways(context.scene, sheet)
    shown = context.window_manager.karf_colorways
    shown.colors.clear()
    for plan in planned:
        for prediction in (each.under_light(reference.light(context.scene)) for each in plan.predictions):
            item = shown.colors.add()
            item.colorway, item.object = plan.colorway.name, prediction.target_color.name
            item.wanted, item.reached = prediction.target, prediction.reached
            item.difference, item.reason = prediction.ciede2000, prediction.reason
    shown.active = next((number for number, item in enumerate(shown.colors) if item.reason), 0)
