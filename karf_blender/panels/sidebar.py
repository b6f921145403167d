"""The steps from capture to picture as panels in their order, the same in both editors.

A step that is done has a check mark in its header. A step that waits for another is greyed out, and its tooltip says
for which.
"""

import bpy

from ..project import disk
from . import editing, learning, marking, rendering
from .status import draw_status, has_status


def has_stage(stage):
    """Whether the engine's stage is done, as a question to a scene."""
    return lambda scene: stage in disk.contents_of(scene).stages


def never(scene):
    """For steps that have no end."""
    return False


# name, title, what it draws, whether it is done while its project is there
SECTIONS = (
    ("status", "Status", draw_status, never),
    ("import", "1  Import", learning.draw_import, lambda scene: bool(scene.karf.project)),
    ("learn", "2  Learn Scene", learning.draw_learn, has_stage("geometry")),
    ("mark", "3  Mark Objects", marking.draw_masks, lambda scene: bool(disk.contents_of(scene).masks)),
    ("segment", "4  Segment", learning.draw_segment, has_stage("segmentation")),
    ("palette", "5  Palette", learning.draw_palette, lambda scene: bool(scene.karf.objects)),
    ("edit", "6  Edit", editing.draw_edit, never),
    ("render", "7  Render", rendering.draw_render, never),
)
EDITORS = (("VIEW_3D", "view3d"), ("IMAGE_EDITOR", "image"))


def make_panel(space: str, editor: str, order: int, name: str, title: str, draw_section, is_done) -> type:
    """A panel class of one section in one editor."""

    def poll(cls, context):
        # without a header it would need no question, but such panels pull their tab before Item, Tool and View
        return name != "status" or has_status(context)

    def draw(self, context):
        draw_section(self.layout, context)

    def draw_header_preset(self, context):
        if is_done(context.scene) and not disk.contents_of(context.scene).missing:
            self.layout.label(text="", icon="CHECKMARK")

    return type(
        f"KARF_PT_{editor}_{name}",
        (bpy.types.Panel,),
        {
            "bl_space_type": space,
            "bl_region_type": "UI",
            "bl_category": "KaRF",
            "bl_label": title,
            "bl_order": order,
            "poll": classmethod(poll),
            "draw": draw,
            "draw_header_preset": draw_header_preset,
        },
    )


CLASSES = tuple(
    make_panel(space, editor, order, *section) for space, editor in EDITORS for order, section in enumerate(SECTIONS)
)
