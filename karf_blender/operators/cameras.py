"""The scene's camera: look through captured cameras, Live Camera, camera paths as files."""

import bpy
from bpy.props import StringProperty

from .. import progress, steps
from ..host.words import translate_report
from ..rig import cameras
from ..steps import preview
from .base import (
    CAMERA,
    GEOMETRY,
    PROJECT,
    OpenFileOperator,
    SaveFileOperator,
    StepOperator,
    Undoable,
    file_filter,
    need,
)


def view_from_camera(area, colored_points: bool = False) -> None:
    """Show the scene's camera in a 3D View; do nothing in other areas."""
    if area is not None and area.type == "VIEW_3D":
        view = area.spaces.active
        view.region_3d.view_perspective = "CAMERA"
        # the lines from all cameras to their Empty would cover the photo
        view.overlay.show_relationship_lines = False
        cameras.turn_about(view.region_3d, bpy.context.scene)
        if colored_points:
            view.shading.color_type = "VERTEX"


class KARF_OT_look_through(StepOperator, bpy.types.Operator):
    """Look through the active view's camera. The scene has the photo's resolution until you leave the view"""

    bl_idname = "karf.look_through"
    bl_label = "Look Through"
    bl_options = {"REGISTER", "UNDO"}
    needs = (PROJECT,)

    view: StringProperty(name="View", description="Empty: the active view", options={"SKIP_SAVE"})

    def step(self, context):
        steps.look_through(context.scene, self.view)
        view_from_camera(context.area)


class KARF_OT_leave_view(StepOperator, bpy.types.Operator):
    """Restore the camera and resolution that the scene had before you looked through a captured camera"""

    bl_idname = "karf.leave_view"
    bl_label = "Leave View"
    bl_options = {"REGISTER", "UNDO"}
    needs = (need("You are not looking through a captured camera", lambda context: context.scene.karf.looking.is_on),)

    def step(self, context):
        steps.leave_view(context.scene)
        if context.area is not None and context.area.type == "VIEW_3D":
            view = context.space_data.region_3d
            view.view_perspective = "PERSP"
            cameras.turn_about(view, context.scene)


class KARF_OT_new_camera(Undoable, bpy.types.Operator):
    """Add a camera, free to move, that sees what this 3D View sees, and make it the scene's"""

    bl_idname = "karf.new_camera"
    bl_label = "New Camera from View"
    needs = (need("Press it in a 3D View", lambda context: getattr(context, "region_data", None)),)

    def step(self, context):
        view, space = context.region_data, context.space_data
        camera = cameras.add_free(context.scene, view.view_matrix, space.lens)
        view.view_perspective = "CAMERA"
        return translate_report("{name} is now the scene's camera", name=camera.name)


class KARF_OT_export_cameras(SaveFileOperator, bpy.types.Operator):
    """Write the scene's camera at every frame of the scene to a transforms.json, relative to the rig"""

    bl_idname = "karf.export_cameras"
    bl_label = "Export Cameras"
    needs = (CAMERA,)

    filepath: StringProperty(subtype="FILE_PATH", default="cameras.json")
    filter_glob: file_filter("*.json")

    def step(self, context):
        progress.wrote(steps.export_cameras(context.scene, self.path).parent)
        count = len(steps.frame_range(context.scene))
        return translate_report("Wrote {count} cameras to {path}", count=count, path=self.path)


class KARF_OT_import_cameras(OpenFileOperator, bpy.types.Operator):
    """Create one animated camera from the cameras in a transforms.json, one frame for each"""

    bl_idname = "karf.import_cameras"
    bl_label = "Import Cameras"
    bl_options = {"REGISTER", "UNDO"}

    filter_glob: file_filter("*.json")

    def step(self, context):
        camera = steps.import_cameras(context.scene, self.path)
        view_from_camera(context.area)
        return translate_report("{name} is now the scene's camera", name=camera.name)


class KARF_OT_live_camera(StepOperator, bpy.types.Operator):
    """Render the scene's camera with the swatches live in the Image Editor, coarse while it moves, fine at rest"""

    bl_idname = "karf.live_camera"
    bl_label = "Live Camera"
    needs = (lambda context: "" if preview.is_live() else GEOMETRY(context) or CAMERA(context),)

    def step(self, context):
        if preview.is_live():
            preview.stop()
        else:
            preview.start(context.scene)
