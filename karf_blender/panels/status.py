"""What the top of the sidebar says, in two rows that are always there: no button below moves while a job runs."""

import bpy

from ..host.labels import draw_text
from ..host.words import translate
from ..project import disk
from ..workspace import statusbar

WIDTH = 60  # letters of a line where the whole message is shown


def draw_status(layout, context):
    """The running job with its cross; else how the last one ended, and the way to what it said."""
    progress = context.window_manager.karf_progress
    column = layout.column()
    if progress.running:
        column.label(text=progress.stage, icon="SORTTIME")
        statusbar.draw_progress(column.row(align=True), progress)
        return
    row = column.row(align=True)
    row.alert = has_trouble(context)
    row.label(**outcome(context))
    if progress.text or progress.error:
        row.operator("karf.dismiss", text="", icon="X", emboss=False)
    row = column.row(align=True)
    messages = row.row(align=True)
    messages.enabled = has_trouble(context) or bool(progress.warnings)
    messages.popover(KARF_PT_message.__name__, text=row_title(context))
    if progress.folder:
        row.operator("karf.open_folder", text="", icon="FILEBROWSER").folder = "written"


def has_trouble(context):
    """Whether the project is gone or the last job has failed."""
    return bool(context.window_manager.karf_progress.error or disk.contents_of(context.scene).missing)


def outcome(context):
    """Text and icon of the upper row while no job runs."""
    progress = context.window_manager.karf_progress
    if disk.contents_of(context.scene).missing:
        return {"text": "The project folder is missing", "icon": "ERROR"}
    if progress.error:
        return {"text": translate("{what} failed", what=translate(progress.stage)), "icon": "ERROR"}
    if progress.text:
        return {"text": f"{translate(progress.stage)}: {translate(progress.text)}", "icon": "INFO"}
    return {"text": "No job is running", "icon": "CHECKMARK"}


def row_title(context):
    """What the lower row's button is called while no job runs."""
    if has_trouble(context):
        return translate("Why, and What to Do")
    count = len(context.window_manager.karf_progress.warnings.splitlines())
    return translate("Messages: {count}", count=count) if count else translate("No Messages")


class KARF_PT_message(bpy.types.Panel):
    """All messages of the last job, and what to do if it failed or the project is missing"""

    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"  # it opens from the status, and is nowhere else
    bl_label = "Messages"
    bl_ui_units_x = 18

    def draw(self, context):
        draw_missing(self.layout, context.scene)
        progress = context.window_manager.karf_progress
        if progress.warnings:
            draw_text(self.layout.box(), progress.warnings, "INFO", WIDTH)
        if progress.error:
            draw_error(self.layout.box(), progress)


def draw_missing(layout, scene):
    """A project folder that is gone, and where to say where it is now."""
    missing = disk.contents_of(scene).missing
    if missing is None:
        return
    box = layout.box()
    box.label(text="The project folder is missing", icon="ERROR")
    draw_text(box, str(missing), "BLANK1", WIDTH)
    draw_text(box, "Restore it, choose its new place, or import the capture again.", "BLANK1", WIDTH)
    box.prop(scene.karf, "project")


def draw_error(box, progress):
    """Why the last job failed, the remedy, and what a developer asks for."""
    column = box.column(align=True)
    column.alert = True
    draw_text(column, progress.error, "ERROR", WIDTH)
    draw_text(box, progress.hint, "BLANK1", WIDTH)
    if progress.job:
        row = box.row(align=True)
        row.operator("karf.copy_report", icon="COPYDOWN")
        row.operator("karf.open_log", icon="TEXT")
