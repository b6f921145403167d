"""Step 1: a capture becomes cameras."""

from dataclasses import replace
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from .. import progress, steps
from ..engine_api import CAPTURE_MARKS
from ..host.words import translate_report
from ..rig.cameras import Options
from ..steps import masks
from ..tasks import runner
from ..tasks.runner import Task
from ..workspace import estimates, opening
from .reporting import has_project, is_free, reports_errors

ORIENTATION_ITEMS = [
    ("AUTO", "Automatic", "Upright where the capture's axes are arbitrary (COLMAP, LLFF), otherwise as in the file"),
    ("FILE", "As in File", "Keep the capture's own axes"),
    ("UPRIGHT", "Upright", "Rotate the capture so that the cameras' average up direction points up"),
]
SPLATS = "*.ply;*.spz;*.splat;*.sog;*.glb;*.gltf;*.usd;*.usda;*.usdc;*.usdz"
UP_ITEMS = [
    ("AUTO", "Automatic", "Choose the axis that runs across the largest flat surfaces, or COLMAP's"),
    *((name, name, f"The file's {name} axis points up") for name in ("X", "Y", "Z", "-X", "-Y", "-Z")),
]
VIDEOS = "*.mp4;*.mov;*.m4v;*.avi;*.mkv;*.webm"


def view_from_camera(area, colored_points: bool = False) -> None:
    """Let a 3D View look through the scene's camera; other areas (or none) are left alone."""
    if area is not None and area.type == "VIEW_3D":
        view = area.spaces.active
        view.region_3d.view_perspective = "CAMERA"
        # the lines from all cameras to their Empty would cover the photo
        view.overlay.show_relationship_lines = False
        if colored_points:
            view.shading.color_type = "VERTEX"


def _then_marked(task: Task) -> Task:
    """A task that imports a capture, after which its first photo is there to be marked."""

    def after(request) -> None:
        task.after(request)
        steps.check_unasked(bpy.context.scene)
        estimates.measure_once()
        opening.set_up(masks.begin_marking, masks.fit_photo)

    return replace(task, after=after)


class RigOptions:
    """Mix-in of operators that build a rig: how it is shown. What is learned stays in the capture's own world."""

    orientation: EnumProperty(name="Orientation", items=ORIENTATION_ITEMS)
    size: FloatProperty(
        name="Size",
        min=0.0,
        subtype="DISTANCE",
        description="Scale the rig so that its cameras span this length. 0: as in the file",
    )
    points: BoolProperty(name="Sparse Points", default=True, description="Show the sparse points shared by the photos")
    photos: BoolProperty(name="Photos", default=True, description="Show each photo behind its camera")
    camera_size: FloatProperty(
        name="Camera Size",
        default=2.5,
        min=0.01,
        soft_max=20.0,
        subtype="PERCENTAGE",
        description="Display size of the cameras, relative to the length they span",
    )

    def draw_options(self) -> None:
        """The options as a column, in the file browser and in the panel of the last operation."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        for name in ("orientation", "size", "points", "photos", "camera_size"):
            self.layout.prop(self, name)

    def rig_options(self) -> Options:
        """The options as the rig takes them."""
        return Options(
            self.orientation.lower(), self.size, self.points, self.photos, camera_size=self.camera_size / 100
        )


class KARF_OT_import_capture(RigOptions, bpy.types.Operator):
    """Create a camera for every photo of a capture, from its folder or camera file: transforms.json, COLMAP, LLFF"""

    bl_idname = "karf.import_capture"
    bl_label = "Import Capture"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    project: StringProperty(
        name="Project", subtype="DIR_PATH", description="Empty: beside the .blend", options={"SKIP_SAVE"}
    )
    holdout: IntProperty(
        name="Keep for Testing",
        default=0,
        min=0,
        soft_max=16,
        description="Keep every Nth photo out of learning, to measure quality with them. 0: learn from all. Where "
        "the capture declares test photos, those are kept out. Marked photos are always learned from",
        options={"SKIP_SAVE"},
    )
    filter_glob: StringProperty(default="*.json;*.npy;*.bin;*.txt", options={"HIDDEN"})

    def invoke(self, context, event):
        if self.filepath:  # a file was dropped
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def draw(self, context):
        if context.area is not None and context.area.type == "FILE_BROWSER":
            column = self.layout.column(align=True)
            for line in ("Choose the folder that has", "one of these, or the file:", *CAPTURE_MARKS):
                column.label(text=line)
        self.draw_options()
        self.layout.prop(self, "project")
        self.layout.prop(self, "holdout")

    @reports_errors
    def execute(self, context):
        project = Path(bpy.path.abspath(self.project)) if self.project else None
        path = Path(bpy.path.abspath(self.filepath))
        # untouched, a project that is learned keeps what it was learned without
        holdout = self.holdout if self.properties.is_property_set("holdout") else None
        capture = steps.import_capture(context.scene, path, project, holdout, self.rig_options())
        for remark in capture.warnings:  # a report of it would lie over the window until it is clicked away
            progress.warn(remark)
        view_from_camera(context.area, colored_points=self.points and capture.points is not None)
        steps.check_unasked(context.scene)
        estimates.measure_once()
        opening.set_up(masks.begin_marking, masks.fit_photo)
        self.report(
            {"INFO"},
            translate_report("Imported {count} cameras from {path}", count=len(capture.views), path=capture.source),
        )
        return {"FINISHED"}


class KARF_OT_find_poses(RigOptions, bpy.types.Operator):
    """Find the camera poses of a folder of photos or a video, and import the result as a capture"""

    bl_idname = "karf.find_poses"
    bl_label = "Find Camera Poses"
    bl_options = {"REGISTER", "PRESET"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default=VIDEOS, options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        return is_free(cls)

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def draw(self, context):
        column = self.layout.column(align=True)
        for line in ("Choose a folder of photos,", "or a video"):
            column.label(text=line)
        self.draw_options()

    @reports_errors
    def execute(self, context):
        path = Path(bpy.path.abspath(self.filepath))
        runner.launch(_then_marked(steps.find_poses(context.scene, path, self.rig_options())))
        return {"FINISHED"}


class KARF_OT_import_splat(RigOptions, bpy.types.Operator):
    """Import Gaussian splats learned by another program, to mark and recolor objects in them"""

    bl_idname = "karf.import_splat"
    bl_label = "Import Splat"
    bl_options = {"REGISTER", "PRESET"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default=SPLATS, options={"HIDDEN"})
    learned_from: StringProperty(
        name="Photos",
        subtype="DIR_PATH",
        description="Capture that the splats were learned from, with the same poses. Empty: render views around the "
        "splats",
        options={"SKIP_SAVE"},
    )
    cameras: StringProperty(
        name="Cameras",
        subtype="FILE_PATH",
        description="Without photos: a transforms.json of exported cameras to render first",
        options={"SKIP_SAVE"},
    )
    views: IntProperty(
        name="Views",
        default=steps.SPLAT_VIEWS,
        min=0,
        soft_max=100,
        description="Without photos: number of views to render",
    )
    up: EnumProperty(name="Up", items=UP_ITEMS, description="Without photos: axis of the file that points up")
    antialiased: BoolProperty(
        name="Antialiased",
        description="The splats were learned with antialiasing (Mip-Splatting), but the file does not say so",
    )

    @classmethod
    def poll(cls, context):
        return is_free(cls)

    def invoke(self, context, event):
        if self.filepath:  # a file was dropped
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def draw(self, context):
        self.draw_options()
        for name in ("learned_from", "cameras", "views", "up", "antialiased"):
            self.layout.prop(self, name)

    @reports_errors
    def execute(self, context):
        photos, cameras = (bpy.path.abspath(each) or None for each in (self.learned_from, self.cameras))
        task = steps.import_splat(
            context.scene,
            bpy.path.abspath(self.filepath),
            photos,
            cameras,
            self.views,
            self.up.lower(),
            self.antialiased,
            self.rig_options(),
        )
        runner.launch(_then_marked(task))
        return {"FINISHED"}


class KARF_OT_check_capture(bpy.types.Operator):
    """Check for blurred photos, drifting exposure, gaps and bad poses, and show where more photos would help"""

    bl_idname = "karf.check_capture"
    bl_label = "Check Capture"

    @classmethod
    def poll(cls, context):
        return has_project(cls, context)

    @reports_errors
    def execute(self, context):
        steps.check_capture(context.scene)
        return {"FINISHED"}


class KARF_OT_look_through(bpy.types.Operator):
    """Look through the active view's camera. The scene has the photo's resolution until you leave the view"""

    bl_idname = "karf.look_through"
    bl_label = "Look Through"
    bl_options = {"REGISTER", "UNDO"}

    view: StringProperty(name="View", description="Empty: the active view", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return has_project(cls, context)

    @reports_errors
    def execute(self, context):
        steps.look_through(context.scene, self.view)
        view_from_camera(context.area)
        return {"FINISHED"}


class KARF_OT_leave_view(bpy.types.Operator):
    """Restore the camera and resolution that the scene had before you looked through a captured camera"""

    bl_idname = "karf.leave_view"
    bl_label = "Leave View"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if not context.scene.karf.looking.is_on:
            cls.poll_message_set("You are not looking through a captured camera")
            return False
        return True

    @reports_errors
    def execute(self, context):
        steps.leave_view(context.scene)
        if context.area is not None and context.area.type == "VIEW_3D":
            context.space_data.region_3d.view_perspective = "PERSP"
        return {"FINISHED"}


class KARF_FH_capture(bpy.types.FileHandler):
    """Import camera files dropped on the 3D View. Other files with these extensions are refused with a message"""

    # folders cannot: Blender asks no handler about a path without an ending
    bl_idname = "KARF_FH_capture"
    bl_label = "KaRF capture"
    bl_import_operator = KARF_OT_import_capture.bl_idname
    bl_file_extensions = ".json;.npy;.bin;.txt"

    @classmethod
    def poll_drop(cls, context):
        kind = context.area.type if context.area else ""
        # the Image Editor takes edits once there are swatches, which may be .json too
        return kind == "VIEW_3D" or (kind == "IMAGE_EDITOR" and not context.scene.karf.objects)


class KARF_FH_splat(bpy.types.FileHandler):
    """Import splats dropped on the 3D View. A .ply without splats is refused with a message"""

    bl_idname = "KARF_FH_splat"
    bl_label = "KaRF splat"
    bl_import_operator = KARF_OT_import_splat.bl_idname
    bl_file_extensions = ".ply;.spz;.splat;.sog"

    @classmethod
    def poll_drop(cls, context):
        return context.area is not None and context.area.type == "VIEW_3D"
