"""The KaRF tab. The Image Editor shows the steps on its picture (marks, swatches), the 3D View the status and all
others; if only one of them has its sidebar open, it shows everything. Finished steps fold (`workspace.states`)."""

from collections.abc import Callable
from dataclasses import dataclass

import bpy

from .. import session
from ..host import windows
from ..host.words import SIDEBAR, draw_text, translatable, translate, translate_message
from ..project import disk
from ..workspace import opening, states, statusbar
from . import editing, learning, rendering, swatching

STEPS, PICTURE = "VIEW_3D", "IMAGE_EDITOR"  # the editors
WIDTH = 60  # letters in a line of the whole message


@dataclass(frozen=True)
class Section:
    """A step in the sidebar."""

    name: str  # one of `states.STEPS`
    title: str
    draw: Callable
    home: str  # the editor that shows it if the screen has both
    page: str  # of the manual


SECTIONS = (
    Section("import", translatable("1  Import"), learning.draw_import, STEPS, "learn"),
    Section("mark", translatable("2  Mark"), learning.draw_mark, PICTURE, "mark"),
    Section("learn", translatable("3  Learn"), learning.draw_learn, STEPS, "learn"),
    Section("edit", translatable("4  Color"), editing.draw_edit, PICTURE, "recolor"),
    Section("render", translatable("5  Render"), rendering.draw_render, STEPS, "render"),
)
HEADERS = {  # text of a header after the step's title
    states.TO_DO: {"text": ""},
    states.DONE: {"text": "done", "icon": "CHECKMARK"},
    states.STALE: {"text": "stale", "icon": "FILE_REFRESH"},
    states.RUNNING: {"text": "running", "icon": "SORTTIME"},
}


def draw_steps(layout, context):
    """Draw the status and those steps that this editor shows."""
    if is_displayed_here(context, STEPS):
        draw_status(layout, context)
    for section in SECTIONS:
        if is_displayed_here(context, section.home):
            _draw_section(layout, context, section)
        elif section.home == PICTURE:
            _draw_elsewhere(layout, section)


def is_displayed_here(context, home: str) -> bool:
    """Return whether this editor shows what belongs to the editor `home`, itself or as a substitute."""
    return context.area.type == home or not any(
        area.type == home and area.spaces.active.show_region_ui for area in context.screen.areas
    )


def _draw_section(layout, context, section: Section):
    header, body = layout.panel_prop(context.window_manager.karf_folding, f"show_{section.name}")
    state = states.state_of(context.scene, section.name)
    header.label(text=section.title)
    right = header.row()
    right.alignment = "RIGHT"
    right.label(**HEADERS[state.kind])
    right.operator("karf.open_manual", text="", icon="HELP", emboss=False).page = section.page
    if body is not None:
        section.draw(body, context)


def _draw_elsewhere(layout, section: Section):
    """Draw one line instead of a step that the Image Editor shows."""
    row = layout.row()
    row.active = False
    row.label(text=section.title, icon="BLANK1")
    right = row.row()
    right.alignment = "RIGHT"
    right.label(text="Image Editor", icon="IMAGE_DATA")


class StepsPanel:
    bl_region_type = "UI"
    bl_category = "KaRF"
    bl_label = "KaRF"

    def draw(self, context):
        draw_steps(self.layout, context)

    def draw_header_preset(self, context):
        if context.workspace.name != opening.NAME:
            self.layout.operator("karf.open_workspace", text="", icon="WORKSPACE", emboss=False)


class KARF_PT_view3d_steps(StepsPanel, bpy.types.Panel):
    bl_space_type = STEPS


class KARF_PT_image_steps(StepsPanel, bpy.types.Panel):
    bl_space_type = PICTURE


def _draw_in_window_menu(self, context):
    self.layout.separator()
    self.layout.operator("karf.open_workspace", icon="WORKSPACE")


@session.subscribe(
    (bpy.types.SpaceView3D, "show_region_ui"),
    (bpy.types.SpaceImageEditor, "show_region_ui"),
    (bpy.types.Area, "ui_type"),
)
def _redraw_when_moved():
    """An editor or its sidebar has come or gone, which decides the place of each step."""
    windows.redraw_sidebars()


def draw_status(layout, context):
    """Draw the running job, or how the last one ended: always two rows, so that no button below moves."""
    progress = context.window_manager.karf_progress
    column = layout.column()
    if progress.running:
        column.label(text=progress.stage, icon="SORTTIME")
        statusbar.draw_progress(column.row(align=True), progress)
        return
    row = column.row(align=True)
    row.alert = _has_trouble(context)
    row.label(**_job_outcome(context))
    if progress.text or progress.error:
        row.operator("karf.dismiss", text="", icon="X", emboss=False)
    row = column.row(align=True)
    messages = row.row(align=True)
    messages.enabled = _has_trouble(context) or bool(progress.warnings)
    messages.popover(KARF_PT_message.__name__, text=_messages_title(context))
    if progress.folder:
        row.operator("karf.open_folder", text="", icon="FILEBROWSER").folder = "written"


def _has_trouble(context):
    return bool(context.window_manager.karf_progress.error or disk.contents_of(context.scene).missing)


def _job_outcome(context):
    progress = context.window_manager.karf_progress
    if disk.contents_of(context.scene).missing:
        return {"text": "The project folder is missing", "icon": "ERROR"}
    if progress.error:
        return {"text": translate("{what} failed", what=translate(progress.stage)), "icon": "ERROR"}
    if progress.text:
        return {"text": f"{translate(progress.stage)}: {translate(progress.text)}", "icon": "INFO"}
    return {"text": "No job is running", "icon": "CHECKMARK"}


def _messages_title(context):
    if _has_trouble(context):
        return translate("Why, and What to Do")
    messages = context.window_manager.karf_progress.warnings.splitlines()
    if not messages:
        return translate("No Messages")
    first = translate_message(messages[0])
    text = first if len(messages) == 1 else f"{len(messages)}: {first}"
    # Blender would leave out the middle
    return text if len(text) <= SIDEBAR else f"{text[:SIDEBAR].rstrip()}\N{HORIZONTAL ELLIPSIS}"


class KARF_PT_message(bpy.types.Panel):
    """All messages of the last job, and what to do if it failed or the project is missing"""

    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"  # it opens from the status, and is nowhere else
    bl_label = "Messages"
    bl_ui_units_x = 18

    def draw(self, context):
        _draw_missing(self.layout, context.scene)
        progress = context.window_manager.karf_progress
        if progress.warnings:
            draw_text(self.layout.box(), progress.warnings, "INFO", WIDTH)
        if progress.error:
            _draw_error(self.layout.box(), progress)


def _draw_missing(layout, scene):
    missing = disk.contents_of(scene).missing
    if missing is None:
        return
    box = layout.box()
    box.label(text="The project folder is missing", icon="ERROR")
    draw_text(box, str(missing), "BLANK1", WIDTH)
    draw_text(box, "Restore it, choose its new place, or import the capture again.", "BLANK1", WIDTH)
    box.prop(scene.karf, "project")


def _draw_error(box, progress):
    column = box.column(align=True)
    column.alert = True
    draw_text(column, progress.error, "ERROR", WIDTH)
    draw_text(box, progress.hint, "BLANK1", WIDTH)
    if progress.job:
        row = box.row(align=True)
        row.operator("karf.copy_report", icon="COPYDOWN")
        row.operator("karf.open_log", icon="TEXT")


def _draw_import(self, context):
    self.layout.operator("karf.import_splat", text="Gaussian Splat (KaRF)")


def _draw_export(self, context):
    self.layout.operator("karf.export_splat", text="Gaussian Splat (KaRF)")


@session.setup
def _menus():
    added = (
        (bpy.types.TOPBAR_MT_file_import, _draw_import),
        (bpy.types.TOPBAR_MT_file_export, _draw_export),
        (bpy.types.UI_MT_button_context_menu, swatching.draw_context_menu),
        (bpy.types.TOPBAR_MT_window, _draw_in_window_menu),
    )
    for menu, draw in added:
        menu.append(draw)
    yield
    for menu, draw in added:
        menu.remove(draw)
