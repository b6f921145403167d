"""Properties of a scene's project, which the .blend keeps: Scene.karf."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..engine_api import PRESETS, KarfError, PointsOptions, bounds_of
from ..host import windows
from ..host.compat import PATH_OPTIONS
from ..marking import mask_layers, objects, photo
from ..project import disk, folders
from ..rig import cameras, reprojection
from ..swatches import displayed, outputs, palettes
from .colors import srgb
from .swatches import KARF_PG_look, KARF_PG_match, KARF_PG_object, edit_changed

PRESET_HELP = {
    "demo": "For a quick preview: photos of 256 pixels, on any computer",
    "fast": "Photos of 400 pixels, on a laptop",
    "fine": "Photos of 400 pixels with voxels half as large, on a laptop with 8 GB of memory",
    "quality": "Photos of 800 pixels, on a graphics card",
    "paper": "Method and settings of the paper, on a graphics card; takes a long time",
}
PRESET_ITEMS = [(name, name.capitalize(), PRESET_HELP[name]) for name in PRESETS]
QUALITY_ITEMS = [
    ("draft", "Draft", "The whole scene alike, from photos at the preset's size"),
    (
        "good",
        "Good",
        "Marked objects from photos of up to 1600 pixels, and the rest as in the draft: some minutes more",
    ),
    (
        "best",
        "Best",
        "Marked objects from photos of up to 4096 pixels, and the rest as in the draft: half an hour more",
    ),
]
COMPOSITING_ITEMS = [
    ("delta", "Photo plus change", "Add the palette's change to the photo. Without changes, the photo stays as it is"),
    ("paper", "Palette only", "Replace the object by its palette mixture, as in the paper"),
]
FORMAT_ITEMS = [
    ("PNG", "PNG", "sRGB values, for any other program"),
    ("OPEN_EXR", "OpenEXR", "Scene-linear light, for compositing"),
]
DEPTH_ITEMS = [
    ("8", "8", "8 bits per channel"),
    ("16", "16", "16 bits per channel (OpenEXR: half float)"),
    ("32", "32", "32 bits per channel (full float)"),
]
FORMAT_DEPTHS = {"PNG": ("8", "16"), "OPEN_EXR": ("16", "32")}  # depths that a format has
MODE_ITEMS = [("RGB", "RGB", "Opaque"), ("RGBA", "RGBA", "Make the background behind the scene transparent")]
SIZE_ITEMS = [
    ("PHOTO", "Photo's Size", "All pixels of the photo, in the photo's file format"),
    ("LEARNED", "Learned Size", "Resolution of the learned photos, for a quick preview"),
    ("PIXELS", "Long Side", "This many pixels on the longer side"),
]


def _view_chosen(self, context):
    displayed.of(self.id_data).refresh()
    photo.follow(self.id_data)
    disk.refresh()


def _masks_chosen(self, context):
    if not folders.is_rewriting() and self.project:
        objects.sync(self.id_data)
    disk.refresh()


def _format_chosen(self, context):
    if self.color_depth not in FORMAT_DEPTHS[self.file_format]:
        self.color_depth = "16"  # which both have


def _project_chosen(self, context):
    # while a file is saved elsewhere, its new paths lead from the new place: here they lead anywhere
    if not folders.is_rewriting():
        palettes.import_learned(self.id_data)
        known = disk.read(self.id_data)
        if known.learned_with[0] in PRESETS:
            self.preset = known.learned_with[0]
        if "geometry" in known.stages:
            for view in self.views:
                view.is_learned = view.name not in known.left_out
        if self.project:
            objects.restart(self.id_data)
        disk.refresh()


def _renamed(self, context):
    try:
        objects.rename(self.id_data, self)
    except (KarfError, OSError) as error:
        self["name"] = self.folder
        print(f"KaRF: the object {self.folder!r} keeps its name: {error}")
    mask_layers.reread(self.id_data)


def _object_chosen(self, context):
    cameras.turn_views_about_object(self.id_data)
    windows.redraw()


def _switched(self, context):
    begin_or_follow = photo.begin_correcting if self.correct else photo.follow
    begin_or_follow(self.id_data)
    windows.redraw()


def PathProperty(subtype="DIR_PATH", **options):
    """A property of a path, which may be relative to the .blend."""
    return StringProperty(subtype=subtype, options=PATH_OPTIONS, **options)


class KARF_PG_marked_object(bpy.types.PropertyGroup):
    """An object to mark."""

    name: StringProperty(
        name="Name", description="Name of the object, its swatches and its folder of masks", update=_renamed
    )
    folder: StringProperty(description="Name of its folder, which stays when the object is renamed")
    number: IntProperty(
        default=-1, description="Index of its color, which stays when the object is renamed. -1: none yet"
    )


class KARF_PG_marking(bpy.types.PropertyGroup):
    """The objects to mark, and the tools that mark them."""

    objects: CollectionProperty(type=KARF_PG_marked_object)
    active: IntProperty(name="Object", description="Object to mark", update=_object_chosen)
    photo: PointerProperty(name="Photo", type=bpy.types.Image, description="Photo to mark")
    brush: IntProperty(
        name="Brush",
        subtype="PIXEL",
        default=25,
        min=1,
        soft_max=200,
        max=2000,
        description="Brush radius on the screen",
    )
    correct: BoolProperty(
        name="Correct",
        description="Correct the segmentation with strokes in any view, on the object or beside it",
        update=_switched,
    )
    step: IntProperty(description="Number of the last stroke, for undo")


class KARF_PG_view(bpy.types.PropertyGroup):
    """A captured view, known by its name."""

    split: StringProperty(name="Split", description="train, val or test")
    is_learned: BoolProperty(
        name="Learn",
        default=True,
        description="Learn from this photo. Off: leave it out; it can still be recolored. A marked photo is always "
        "learned from",
    )
    is_blurred: BoolProperty(description="Check Capture has found it less sharp than the photos beside it")


class KARF_PG_looking(bpy.types.PropertyGroup):
    """The scene's camera and resolution before and while a captured camera is looked through."""

    is_on: BoolProperty(name="Looking Through")
    camera: PointerProperty(name="Camera", type=bpy.types.Object)
    before: FloatVectorProperty(name="Picture Before", size=len(cameras.PICTURE))
    during: FloatVectorProperty(name="Picture", size=len(cameras.PICTURE))
    hides_others: BoolProperty(
        name="Hide Others",
        description="Hide the other cameras and the sparse points while one camera is looked through",
        update=lambda self, context: cameras.hide_others(self.id_data),
    )


class KARF_PG_surface(bpy.types.PropertyGroup):
    """The objects that show the learned scene."""

    count: IntProperty(
        name="Points",
        default=bounds_of(PointsOptions, "count")["default"],
        min=1000,
        max=600_000,
        step=10_000,
        description="Approximate number. Ten times as many show finer detail, but follow swatches more slowly",
    )
    item: PointerProperty(name="Object", type=bpy.types.Object, description="Object that shows the learned scene")
    splat: PointerProperty(name="Splat", type=bpy.types.Object, description="Splat object colored by the swatches")


class KARF_PG_scene(bpy.types.PropertyGroup):
    """A scene's project, palettes and edits."""

    project: PathProperty(
        name="Project",
        description="Folder of everything learned. Choosing one with palettes loads its swatches",
        update=_project_chosen,
    )
    stays_hidden: BoolProperty(description="The question about moving the project beside the file was declined")
    capture: PathProperty("FILE_PATH", name="Capture", description="Cameras and photos")
    masks: PathProperty(
        name="Masks",
        description="Folder with <object>/<photo name>.png, white where the object is",
        update=_masks_chosen,
    )
    out: PathProperty(name="Output", description="Folder for pictures. Empty: the folder out in the project")
    frames: PathProperty(name="Frames", description="Path of the last rendered frames, or their folder")
    file_names: StringProperty(
        name="File Names",
        default=outputs.DEFAULT,
        description="Path of pictures in the output folder, without suffix: {look}, {view}, {scene}, and {frame}, the "
        "number at the end of the view's name. A camera's frames are below cameras/<camera>",
    )
    layered: BoolProperty(
        name="Layered File",
        description="Write each picture as layers too, to finish by hand: OpenEXR with the photo, the recolored picture, "
        "and each object's mask and change",
    )
    overwrite: BoolProperty(
        name="Overwrite",
        description="Write over pictures of another look or of other swatches. Off: use the next free name",
    )
    captured_size: EnumProperty(name="Size", items=SIZE_ITEMS, description="File format of recolored photos")
    captured_pixels: IntProperty(
        name="Long Side",
        subtype="PIXEL",
        default=1024,
        min=16,
        max=65536,
        description="File format of recolored photos",
    )
    file_format: EnumProperty(
        name="File Format", items=FORMAT_ITEMS, description="File format of a camera's frames", update=_format_chosen
    )
    color_mode: EnumProperty(name="Color", items=MODE_ITEMS, description="File format of a camera's frames")
    color_depth: EnumProperty(name="Color Depth", items=DEPTH_ITEMS, description="File format of a camera's frames")
    skip_existing: BoolProperty(
        name="Skip Existing",
        default=True,
        description="Keep existing frames that would not change, and continue where a job was stopped",
    )
    fade_unseen: BoolProperty(
        name="Fade Unseen",
        default=True,
        description="Fade surfaces to gray that no photo shows well, in the rendered 3D View and in cameras' "
        "frames. Off: show the splats as they are",
        update=lambda self, context: windows.redraw("VIEW_3D"),
    )
    preset: EnumProperty(name="Preset", items=PRESET_ITEMS, description="Quality and duration of learning")
    splat_quality: EnumProperty(
        name="Splat Quality", items=QUALITY_ITEMS, description="What splats are learned from, and how long it takes"
    )
    nerf: PathProperty(
        "FILE_PATH",
        name="Pretrained NeRF",
        description="Checkpoint of a NeRF that another program has trained on this capture, used as the geometry "
        "(nerf-pytorch, krrish94). Empty: learn the geometry",
    )
    photo_space: StringProperty(
        name="Photo Space",
        description="OpenColorIO color space of the photo files, such as ACEScg. Recolored photos are written in "
        "it. Empty: sRGB, or linear light for OpenEXR. Requires the engine's extra color",
    )
    layer_space: StringProperty(
        name="Layer Space",
        description="OpenColorIO color space of the picture in the layers, such as ACEScg. Empty: linear Rec. 709. "
        "Requires the engine's extra color",
    )
    ocio: PathProperty(
        "FILE_PATH",
        name="Color Config",
        description="OpenColorIO configuration with these spaces (config.ocio). Empty: the one in the variable "
        "OCIO, or the engine's own",
    )
    card: srgb(
        "Gray Card",
        description="Color of a gray card (L* 50, 18 %) in the photos. Pick it in the picture (E), and color names "
        "and numbers refer to daylight. Black: no card",
    )
    chart: FloatVectorProperty(
        size=9,
        description="Matrix from linear light under daylight to that in the photos, from a color chart. Zeros: no "
        "chart",
    )
    chart_left: FloatProperty(description="Mean CIEDE2000 of the chart's patches")
    material: BoolProperty(
        name="Material",
        default=True,
        description="When you drag a swatch, the paint's shades and its pale and dark colors follow, while "
        "highlights keep the light's color. Off: each swatch moves alone",
    )
    compositing: EnumProperty(name="Compositing", items=COMPOSITING_ITEMS, update=edit_changed)
    rig: PointerProperty(
        name="Rig", type=bpy.types.Object, description="Empty that is the parent of the captured cameras"
    )
    views: CollectionProperty(type=KARF_PG_view)
    holdout: IntProperty(
        name="Keep for Testing",
        default=-1,
        description="Keep every Nth photo out of learning. -1: as in the learned scene",
    )
    looking: PointerProperty(type=KARF_PG_looking)
    n_points: IntProperty(name="Points", description="Sparse points of the capture")
    show_reprojection: BoolProperty(
        name="Reprojection Errors",
        description="Draw lines over the current photo from each projected sparse point to its position in the "
        "photo: green where they agree, red from 4 pixels",
        update=lambda self, context: reprojection.refresh(self.id_data),
    )
    advice: StringProperty(description="Results of checking the capture, one per line. Empty: not checked")
    is_poor: BoolProperty(description="More photos are recommended before learning")
    active_view: StringProperty(name="View", description="Captured view to show", update=_view_chosen)
    active_number: IntProperty(
        description="Place of the active view in the list",
        get=lambda self: self.views.find(self.active_view),
        set=lambda self, number: setattr(self, "active_view", self.views[number].name),
    )
    objects: CollectionProperty(type=KARF_PG_object)
    looks: CollectionProperty(type=KARF_PG_look)
    look: StringProperty(name="Look", description="Look in use. Empty: none")
    look_before: StringProperty(description="Look used before, to switch back to")
    surface: PointerProperty(type=KARF_PG_surface)
    match: PointerProperty(type=KARF_PG_match)
    result: PointerProperty(name="Result", type=bpy.types.Image, description="Recolored picture")
    marking: PointerProperty(type=KARF_PG_marking)
