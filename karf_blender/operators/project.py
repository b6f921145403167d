"""The project's folders, the manual and the workspace."""

import re
from pathlib import Path

import bpy
from bpy.props import EnumProperty

from .. import progress, steps
from ..engine_api import BadRequest
from ..host import windows
from ..host.words import translate, translate_report
from ..project import folders, moving
from ..steps import masks
from ..swatches import outputs
from ..workspace import opening
from .base import IDLE, PROJECT, StepOperator, need

MANUAL = Path(__file__).resolve().parents[2] / "docs" / "tasks"
MANUAL_TEXT = "KaRF manual"  # the name of the text in the file
MARKUP = re.compile(r"\*\*|(?<=\])\([^)]*\)")  # bold words, and where links lead
PAGE_ITEMS = [
    ("learn", "Import and Learn", "From photos to a learned scene"),
    ("mark", "Mark", "Show where the objects are in a few photos"),
    ("correct", "Correct", "Correct wrong masks"),
    ("recolor", "Recolor", "Swatches and other ways to change a color"),
    ("render", "Render", "Render recolored photos and views of other cameras"),
    ("colorways", "Colorways and Looks", "Many variants"),
    ("composite", "Composite", "Recolor with nodes, without the extension"),
    ("page", "Web Page", "The looks in a client's browser"),
    ("show_in_3d", "Show in 3D", "The scene as an object"),
    ("splats", "Splats", "Exchange splats with other programs"),
]
FOLDER_ITEMS = [
    ("project", "Project", "Everything learned"),
    ("out", "Output", "Folder for rendered pictures"),
    ("frames", "Frames", "Last rendered pictures"),
    ("written", "Written", "Folder of the last written files"),
]


class KARF_OT_move_project(StepOperator, bpy.types.Operator):
    """Move the project from the extension's folder to the .blend's, to share both together. Saves the file"""

    bl_idname = "karf.move_project"
    bl_label = "Move Project Beside File"
    needs = (
        IDLE,
        PROJECT,
        need("Save the file first", lambda context: bpy.data.filepath),
        need("The project is beside the file already", lambda context: moving.is_hidden(context.scene)),
    )

    def invoke(self, context, event):
        self.place = str(moving.place_beside(context.scene))
        title = translate("Move the project beside the file?")
        return context.window_manager.invoke_props_dialog(self, width=420, title=title, confirm_text=translate("Move"))

    def draw(self, context):
        column = self.layout.column(align=True)
        column.label(text="The project is in the extension's own folder.")
        column.label(text="Beside the file, it is shared and backed up with it.")
        column.label(text=self.place, icon="FILE_FOLDER")

    def cancel(self, context):
        context.scene.karf.stays_hidden = True  # it is not asked again; the button in step 1 stays

    def step(self, context):
        place = steps.move_project(context.scene)
        return translate_report("The project is in {path}", path=place)


class KARF_OT_open_folder(StepOperator, bpy.types.Operator):
    """Open this folder in the file manager"""

    bl_idname = "karf.open_folder"
    bl_label = "Open Folder"
    needs = (PROJECT,)

    folder: EnumProperty(name="Folder", items=FOLDER_ITEMS, options={"SKIP_SAVE"})

    def step(self, context):
        folder = _folder_of(context.scene, self.folder)
        if not folder.is_dir():
            raise BadRequest("{path} does not exist yet.", "Render something first.", path=folder)
        bpy.ops.wm.path_open(filepath=str(folder))


def _folder_of(scene: bpy.types.Scene, kind: str) -> Path:
    if kind == "project":
        return folders.project_of(scene).folder
    if kind == "written":
        return Path(progress.state().folder)
    frames = folders.place_of(scene, "frames") if kind == "frames" else None
    return outputs.folder_of(frames) if frames else folders.out_folder(scene)


class KARF_OT_open_manual(StepOperator, bpy.types.Operator):
    """Open this step's manual page in a Text Editor"""

    bl_idname = "karf.open_manual"
    bl_label = "Open Manual"

    page: EnumProperty(name="Page", items=PAGE_ITEMS)

    def step(self, context):
        lines = (MANUAL / f"{self.page}.md").read_text(encoding="utf-8").splitlines()
        text = "\n".join(MARKUP.sub("", line) for line in lines if not line.startswith("!["))  # a picture
        windows.show_text(MANUAL_TEXT, text)


class KARF_OT_open_workspace(StepOperator, bpy.types.Operator):
    bl_description = (
        "Go to the KaRF workspace: 3D View, Image Editor and timeline, both sidebars at the KaRF tab. "
        "It is added to the file the first time. An imported capture is ready to mark there"
    )
    bl_idname = "karf.open_workspace"
    bl_label = "KaRF Workspace"

    def step(self, context):
        opening.open_workspace(context.window)
        opening.set_up(masks.begin_marking, masks.fit_photo)
