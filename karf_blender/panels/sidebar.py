"""The steps from capture to picture, one below the other in one panel, each beside what it works on.

Marks and swatches are beside the picture, in the Image Editor; the status and the other steps in the 3D View. An editor
shows a step of the other where the screen has not that one's sidebar, so that nothing stands twice side by side, and
nothing is missing where an artist has one of them alone.

Each step's header says how it stands, and has a button that opens its page of the manual. Steps that are done fold
themselves (`workspace.states`), which only a panel in a layout allows: of panels of their own Blender keeps to itself
which are open. A step that waits for another is greyed out, and its tooltip says for which.
"""

from collections.abc import Callable
from dataclasses import dataclass

import bpy

from .. import session
from ..host import windows
from ..host.labels import draw_text
from ..host.words import translatable
from ..workspace import opening, states
from . import editing, learning, marking, rendering
from .status import draw_status

STEPS, PICTURE = "VIEW_3D", "IMAGE_EDITOR"  # the editors


@dataclass(frozen=True)
class Section:
    """A step in the sidebar.

    Attributes:
        name: One of `states.STEPS`.
        title: Of its header.
        draw: Draws what is below that.
        home: The editor that shows it where the screen has both.
        page: Of the manual, see `operators.manual`.
    """

    name: str
    title: str
    draw: Callable
    home: str
    page: str


SECTIONS = (
    Section("import", translatable("1  Import"), learning.draw_import, STEPS, "learn"),
    Section("learn", translatable("2  Learn Scene"), learning.draw_learn, STEPS, "learn"),
    Section("mark", translatable("3  Mark Objects"), marking.draw_masks, PICTURE, "mark"),
    Section("segment", translatable("4  Segment"), learning.draw_segment, STEPS, "correct"),
    Section("palette", translatable("5  Palette"), learning.draw_palette, STEPS, "recolor"),
    Section("edit", translatable("6  Edit"), editing.draw_edit, PICTURE, "recolor"),
    Section("render", translatable("7  Render"), rendering.draw_render, STEPS, "render"),
)
EDITORS = ((STEPS, "view3d"), (PICTURE, "image"))
HEADERS = {  # text of a header after the step's title
    states.TO_DO: {"text": ""},
    states.DONE: {"text": "done", "icon": "CHECKMARK"},
    states.STALE: {"text": "stale", "icon": "FILE_REFRESH"},
    states.RUNNING: {"text": "running", "icon": "SORTTIME"},
}


def draw_steps(layout, context):
    """What of the status and of all steps is this editor's to show."""
    if is_here(context, STEPS):
        draw_status(layout, context)
    for section in SECTIONS:
        if is_here(context, section.home):
            draw_section(layout, context, section)
        elif section.home == PICTURE:
            draw_elsewhere(layout, section)


def is_here(context, home: str) -> bool:
    """Whether the editor that is drawn shows what is at home in one of this type: that one, or what stands in for it."""
    return context.area.type == home or not any(
        area.type == home and area.spaces.active.show_region_ui for area in context.screen.areas
    )


def draw_section(layout, context, section: Section):
    """A step: its header, and what is below that unless it is folded."""
    header, body = layout.panel_prop(context.window_manager.karf_folding, f"show_{section.name}")
    state = states.state_of(context.scene, section.name)
    header.label(text=section.title)
    right = header.row()
    right.alignment = "RIGHT"
    right.label(**HEADERS[state.kind])
    right.operator("karf.open_manual", text="", icon="HELP", emboss=False).page = section.page
    if body is not None:
        draw_text(body, state.reason, "FILE_REFRESH")
        section.draw(body, context)


def draw_elsewhere(layout, section: Section):
    """Where a step is that the list of steps has not: one line in its place."""
    row = layout.row()
    row.active = False
    row.label(text=section.title, icon="BLANK1")
    right = row.row()
    right.alignment = "RIGHT"
    right.label(text="Image Editor", icon="IMAGE_DATA")


def make_panel(space: str, editor: str) -> type:
    """The panel class of one editor."""

    def draw(self, context):
        draw_steps(self.layout, context)

    def draw_header_preset(self, context):
        if context.workspace.name != opening.NAME:
            self.layout.operator("karf.open_workspace", text="", icon="WORKSPACE", emboss=False)

    return type(
        f"KARF_PT_{editor}_steps",
        (bpy.types.Panel,),
        {
            "bl_space_type": space,
            "bl_region_type": "UI",
            "bl_category": "KaRF",
            "bl_label": "KaRF",
            "draw": draw,
            "draw_header_preset": draw_header_preset,
        },
    )


def draw_in_window_menu(self, context):
    """The way to the workspace from anywhere, at the end of Blender's menu Window."""
    self.layout.separator()
    self.layout.operator("karf.open_workspace", icon="WORKSPACE")


CLASSES = tuple(make_panel(space, editor) for space, editor in EDITORS)


@session.subscribe(
    (bpy.types.SpaceView3D, "show_region_ui"),
    (bpy.types.SpaceImageEditor, "show_region_ui"),
    (bpy.types.Area, "ui_type"),
)
def _redraw_when_moved():
    """A sidebar is opened or closed, or an editor becomes another: it decides where steps are shown."""
    windows.redraw_sidebars()
