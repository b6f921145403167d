"""The manual's pages, which come with the extension: no network is needed, and no other program."""

import re
from pathlib import Path

import bpy
from bpy.props import EnumProperty

from ..host import windows
from .reporting import reports_errors

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "tasks"
NAME = "KaRF manual"  # of the text in the file
PICTURE = "!["  # how a line begins that is a picture, of which there are none here
MARKUP = re.compile(r"\*\*|(?<=\])\([^)]*\)")  # of bold words, and where links lead
PAGE_ITEMS = [
    ("learn", "Import and Learn", "From photos to a learned scene"),
    ("mark", "Mark", "Where the objects are in a few photos"),
    ("correct", "Correct", "Where the masks are wrong"),
    ("recolor", "Recolor", "Swatches, and all that changes a color"),
    ("render", "Render", "Recolored photos, and what other cameras see"),
    ("colorways", "Colorways and Looks", "Many variants"),
    ("composite", "Composite", "Nodes that recolor without the extension"),
    ("show_in_3d", "Show in 3D", "The scene as an object"),
    ("splats", "Splats", "From and to other programs"),
]


class KARF_OT_open_manual(bpy.types.Operator):
    """Read in a Text Editor how this is done, and what each control does"""

    bl_idname = "karf.open_manual"
    bl_label = "Open Manual"

    page: EnumProperty(name="Page", items=PAGE_ITEMS)

    @reports_errors
    def execute(self, context):
        windows.show_text(NAME, text_of(self.page))
        return {"FINISHED"}


def text_of(page: str) -> str:
    """A page as it is read in a Text Editor. Raises OSError where the extension has lost it."""
    lines = (FOLDER / f"{page}.md").read_text(encoding="utf-8").splitlines()
    return "\n".join(MARKUP.sub("", line) for line in lines if not line.startswith(PICTURE))
