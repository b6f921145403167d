"""What the top of the sidebar says: a project that is gone, the running job, how the last one ended."""

from ..host.labels import draw_text
from ..project import disk


def has_status(context):
    """Whether there is anything to show in the status."""
    progress = context.window_manager.karf_progress
    has_message = progress.running or progress.text or progress.warnings or progress.error
    return bool(has_message or disk.contents_of(context.scene).missing)


def draw_status(layout, context):
    """A project that is gone; the running job, or how the last one ended."""
    missing = disk.contents_of(context.scene).missing
    if missing is not None:
        box = layout.box()
        box.label(text="The project folder is missing", icon="ERROR")
        draw_text(box, f"{missing}\nBring it back, choose where it is now, or import the capture again.", "BLANK1")
        box.prop(context.scene.karf, "project")
    progress = context.window_manager.karf_progress
    if progress.running:
        layout.label(text=progress.stage, icon="SORTTIME")
        row = layout.row(align=True)
        row.progress(factor=progress.fraction, text=progress.text)
        row.operator("karf.cancel", text="", icon="CANCEL")
        if progress.figures:
            layout.label(text=progress.figures, icon="BLANK1")
    elif progress.text and not progress.error:
        dismissible(layout, f"{progress.stage}: {progress.text}", "INFO")
    if progress.warnings:
        draw_text(layout.box(), progress.warnings, "INFO")
    if progress.error:
        box = layout.box()
        dismissible(box, f"{progress.stage} failed", "ERROR")
        column = box.column(align=True)
        column.alert = True
        draw_text(column, progress.error, "BLANK1")
        draw_text(box, progress.hint, "BLANK1")
        if progress.job:
            row = box.row(align=True)
            row.operator("karf.copy_report", icon="COPYDOWN")
            row.operator("karf.open_log", icon="TEXT")


def dismissible(layout, text, icon):
    """A line that the user can close."""
    row = layout.row()
    row.label(text=text, icon=icon)
    row.operator("karf.dismiss", text="", icon="X", emboss=False)
