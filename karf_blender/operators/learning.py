"""Steps 1 and 3: import photos or splats; learn scene, masks, palettes and splats."""

from dataclasses import replace
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from .. import progress, steps
from ..engine_api import CAPTURE_MARKS
from ..host.words import translate_report
from ..rig.cameras import Options
from ..steps import masks
from ..swatches import palettes
from ..tasks.runner import Task
from ..workspace import estimates, opening
from .base import GEOMETRY, IDLE, PROJECT, SEGMENTATION, OpenFileOperator, StepOperator, Undoable, file_filter, need
from .cameras import view_from_camera

ORIENTATION_ITEMS = [
    ("AUTO", "Automatic", "Upright where the capture's axes are arbitrary (COLMAP, LLFF), otherwise as in the file"),
    ("FILE", "As in File", "Keep the capture's own axes"),
    ("UPRIGHT", "Upright", "Rotate the capture so that the cameras' average up direction points up"),
]
SPLAT_FILES = "*.ply;*.spz;*.splat;*.sog;*.glb;*.gltf;*.usd;*.usda;*.usdc;*.usdz"
UP_ITEMS = [
    ("AUTO", "Automatic", "Choose the axis that runs across the largest flat surfaces, or COLMAP's"),
    *((name, name, f"The file's {name} axis points up") for name in ("X", "Y", "Z", "-X", "-Y", "-Z")),
]
VIDEO_FILES = "*.mp4;*.mov;*.m4v;*.avi;*.mkv;*.webm"
MASKS = need(
    "Mark an object first: paint a mask, or choose a folder of masks", lambda context: context.scene.karf.masks
)


def _begin_marking() -> None:
    steps.check_unasked(bpy.context.scene)
    estimates.measure_once()
    opening.set_up(masks.begin_marking, masks.fit_photo)


def _then_mark(task: Task) -> Task:
    def after(request) -> None:
        task.after(request)
        _begin_marking()

    return replace(task, after=after)


class ImportOperator(OpenFileOperator):
    """Mix-in of operators that import a capture, with options for the display of its rig."""

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
        self.layout.use_property_split, self.layout.use_property_decorate = True, False
        for name in ("orientation", "size", "points", "photos", "camera_size"):
            self.layout.prop(self, name)

    def rig_options(self) -> Options:
        return Options(
            self.orientation.lower(), self.size, self.points, self.photos, camera_size=self.camera_size / 100
        )


class KARF_OT_import_capture(ImportOperator, bpy.types.Operator):
    """Create a camera for every photo of a capture, from its folder or camera file: transforms.json, COLMAP, LLFF"""

    bl_idname = "karf.import_capture"
    bl_label = "Import Capture"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    project: StringProperty(
        name="Project", subtype="DIR_PATH", description="Empty: beside the .blend", options={"SKIP_SAVE"}
    )
    holdout: IntProperty(
        name="Keep for Testing",
        min=0,
        soft_max=16,
        description="Keep every Nth photo out of learning, to measure quality with them. 0: learn from all. Where "
        "the capture declares test photos, those are kept out. Marked photos are always learned from",
        options={"SKIP_SAVE"},
    )
    filter_glob: file_filter("*.json;*.npy;*.bin;*.txt")

    def draw(self, context):
        if context.area is not None and context.area.type == "FILE_BROWSER":
            column = self.layout.column(align=True)
            for line in ("Choose the folder that has", "one of these, or the file:", *CAPTURE_MARKS):
                column.label(text=line)
        self.draw_options()
        self.layout.prop(self, "project")
        self.layout.prop(self, "holdout")

    def step(self, context):
        project = Path(bpy.path.abspath(self.project)) if self.project else None
        # untouched, a project that is learned keeps what it was learned without
        holdout = self.holdout if self.properties.is_property_set("holdout") else None
        capture = steps.import_capture(context.scene, self.path, project, holdout, self.rig_options())
        for remark in capture.warnings:  # a report of it would lie over the window until it is clicked away
            progress.warn(remark)
        view_from_camera(context.area, colored_points=self.points and capture.points is not None)
        _begin_marking()
        return translate_report("Imported {count} cameras from {path}", count=len(capture.views), path=capture.source)


class KARF_OT_find_poses(ImportOperator, bpy.types.Operator):
    """Find the camera poses of a folder of photos or a video, and import the result as a capture"""

    bl_idname = "karf.find_poses"
    bl_label = "Find Camera Poses"
    bl_options = {"REGISTER", "PRESET"}
    needs = (IDLE,)

    filter_glob: file_filter(VIDEO_FILES)

    def draw(self, context):
        column = self.layout.column(align=True)
        for line in ("Choose a folder of photos,", "or a video"):
            column.label(text=line)
        self.draw_options()

    def step(self, context):
        return _then_mark(steps.find_poses(context.scene, self.path, self.rig_options()))


class KARF_OT_import_splat(ImportOperator, bpy.types.Operator):
    """Import Gaussian splats learned by another program, to mark and recolor objects in them"""

    bl_idname = "karf.import_splat"
    bl_label = "Import Splat"
    bl_options = {"REGISTER", "PRESET"}
    needs = (IDLE,)

    filter_glob: file_filter(SPLAT_FILES)
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

    def draw(self, context):
        self.draw_options()
        for name in ("learned_from", "cameras", "views", "up", "antialiased"):
            self.layout.prop(self, name)

    def step(self, context):
        photos, cameras = (bpy.path.abspath(each) or None for each in (self.learned_from, self.cameras))
        options = self.views, self.up.lower(), self.antialiased, self.rig_options()
        return _then_mark(steps.import_splat(context.scene, self.path, photos, cameras, *options))


class KARF_OT_check_capture(StepOperator, bpy.types.Operator):
    """Check for blurred photos, drifting exposure, gaps and bad poses, and show where more photos would help"""

    bl_idname = "karf.check_capture"
    bl_label = "Check Capture"
    needs = (PROJECT,)
    scene_step = steps.check_capture


class KARF_OT_leave_out_blurred(Undoable, bpy.types.Operator):
    """Leave the photos out of learning that Check Capture has found blurred"""

    bl_idname = "karf.leave_out_blurred"
    bl_label = "Leave Out Blurred"
    needs = (
        need(
            "Check Capture has found no blurred photos",
            lambda context: any(view.is_blurred for view in context.scene.karf.views),
        ),
    )

    def step(self, context):
        names = steps.leave_out_blurred(context.scene)
        return translate_report("Left out {count} photos", count=len(names))


class KARF_FH_capture(bpy.types.FileHandler):
    """Import camera files dropped on the 3D View. Other files with these extensions are refused with a message"""

    # folders cannot: Blender asks no handler about a path without an ending
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

    bl_label = "KaRF splat"
    bl_import_operator = KARF_OT_import_splat.bl_idname
    bl_file_extensions = ".ply;.spz;.splat;.sog"

    @classmethod
    def poll_drop(cls, context):
        return context.area is not None and context.area.type == "VIEW_3D"


class KARF_OT_learn_scene(StepOperator, bpy.types.Operator):
    """Learn the scene's geometry from the photos"""

    bl_idname = "karf.learn_scene"
    bl_label = "Learn Scene"
    needs = (IDLE, PROJECT)
    scene_step = steps.learn_scene


class PaletteOperator(StepOperator):
    """Mix-in of operators that replace the palettes, after a confirmation if there are edits."""

    def invoke(self, context, event):
        if not palettes.has_edits(context.scene):
            return self.execute(context)
        message = "Edits follow their object and color; those that find none are kept in the project"
        return context.window_manager.invoke_confirm(self, event, title="Extract anew?", message=message)


class KARF_OT_learn_all(PaletteOperator, bpy.types.Operator):
    bl_description = (
        "Learn the scene, segment the marked objects, extract their palettes, and show the active view. "
        "What is finished is kept"
    )
    bl_idname = "karf.learn_all"
    bl_label = "Learn All"
    needs = (IDLE, PROJECT, MASKS)
    scene_step = steps.learn_all


class KARF_OT_segment(StepOperator, bpy.types.Operator):
    """Turn the coarse masks into clean ones in every view"""

    bl_idname = "karf.segment"
    bl_label = "Segment"
    needs = (IDLE, PROJECT, GEOMETRY, MASKS)
    scene_step = steps.segment


class KARF_OT_extract_palette(PaletteOperator, bpy.types.Operator):
    bl_description = (
        "Find the swatches of every object and their share in each pixel. Edits, locks and keyframes "
        "stay with their object and color. Edits whose color no longer exists are kept in the project's "
        "folder edits"
    )
    bl_idname = "karf.extract_palette"
    bl_label = "Extract Palette"
    needs = (IDLE, PROJECT, SEGMENTATION)
    scene_step = steps.extract_palette


class KARF_OT_learn_splats(StepOperator, bpy.types.Operator):
    """Learn the scene as Gaussian splats, in the quality chosen: new cameras then render it sharper and much faster"""

    bl_idname = "karf.learn_splats"
    bl_label = "Learn Splats"
    needs = (IDLE, PROJECT, GEOMETRY)
    scene_step = steps.learn_splats
