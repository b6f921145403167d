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
    ("mark", "Mark", "Show where the objects are in a few photos"),
    ("correct", "Correct", "Correct wrong masks"),
    ("recolor", "Recolor", "Swatches and other ways to change a color"),
    ("render", "Render", "Render recolored photos and views of other cameras"),
    ("colorways", "Colorways and Looks", "Many variants"),
    ("composite", "Composite", "Recolor with nodes, without the extension"),
    ("show_in_3d", "Show in 3D", "The scene as an object"),
    ("splats", "Splats", "Exchange splats with other programs"),
]


class KARF_OT_open_manual(bpy.types.Operator):
    """Open this step's manual page in a Text Editor"""

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
