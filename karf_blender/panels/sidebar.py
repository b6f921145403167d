"""The steps from capture to picture, one below the other in one panel, the same in both editors.

Each step's header says how it stands. Steps that are done fold themselves (`workspace.folding`), which only a panel in
a layout allows: of panels of their own Blender keeps to itself which are open. A step that waits for another is greyed
out, and its tooltip says for which.
"""

import bpy

from ..host.labels import draw_text
from ..host.words import translatable
from ..workspace import opening, states
from . import editing, learning, marking, rendering
from .status import draw_status

# name, title, what it draws
SECTIONS = (
    ("import", translatable("1  Import"), learning.draw_import),
    ("learn", translatable("2  Learn Scene"), learning.draw_learn),
    ("mark", translatable("3  Mark Objects"), marking.draw_masks),
    ("segment", translatable("4  Segment"), learning.draw_segment),
    ("palette", translatable("5  Palette"), learning.draw_palette),
    ("edit", translatable("6  Edit"), editing.draw_edit),
    ("render", translatable("7  Render"), rendering.draw_render),
)
EDITORS = (("VIEW_3D", "view3d"), ("IMAGE_EDITOR", "image"))
HEADERS = {  # text of a header after the step's title
    states.TO_DO: {"text": ""},
    states.DONE: {"text": "done", "icon": "CHECKMARK"},
    states.STALE: {"text": "stale", "icon": "FILE_REFRESH"},
    states.RUNNING: {"text": "running", "icon": "SORTTIME"},
}


def draw_steps(layout, context):
    """The status, and all steps."""
    draw_status(layout, context)
    folding = context.window_manager.karf_folding
    for name, title, draw_section in SECTIONS:
        header, body = layout.panel_prop(folding, f"show_{name}")
        state = states.state_of(context.scene, name)
        header.label(text=title)
        right = header.row()
        right.alignment = "RIGHT"
        right.label(**HEADERS[state.kind])
        if body is not None:
            draw_text(body, state.reason, "FILE_REFRESH")
            draw_section(body, context)


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
