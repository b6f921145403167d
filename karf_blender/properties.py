"""What the .blend keeps (Scene.karf: saved, undone, keyframed) and what it does not (WindowManager.karf_progress)."""

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

from .engine_api import BRIGHTEST, COMPOSITING_MODES, PRESETS
from .host.compat import PATH_OPTIONS
from .project import disk, folders
from .rig import reprojection
from .swatches import palettes, recolor

PRESET_ITEMS = [
    (name, name.capitalize(), f"Learn from pictures of at most {settings.geometry.long_side} pixels")
    for name, settings in PRESETS.items()
]
COMPOSITING_NAMES = {"delta": "Photo plus change", "paper": "Palette only"}
COMPOSITING_HELP = {
    "delta": "Add the palette's change to the photo: nothing changed leaves the photo as it is",
    "paper": "Replace the object by its palette mixture, as in the paper",
}
COMPOSITING_ITEMS = [(name, COMPOSITING_NAMES[name], COMPOSITING_HELP[name]) for name in COMPOSITING_MODES]
FORMAT_ITEMS = [
    ("PNG", "PNG", "sRGB numbers, for all other programs"),
    ("OPEN_EXR", "OpenEXR", "Scene-linear light, for compositing"),
]
DEPTH_ITEMS = [
    ("8", "8", "8 bits a channel"),
    ("16", "16", "16 bits a channel; of OpenEXR half floats"),
    ("32", "32", "32 bits a channel: full floats"),
]
FORMAT_DEPTHS = {"PNG": ("8", "16"), "OPEN_EXR": ("16", "32")}  # that a format has
MODE_ITEMS = [("RGB", "RGB", "Opaque"), ("RGBA", "RGBA", "What is behind the scene is transparent")]
SIZE_ITEMS = [
    ("PHOTO", "Photo's Size", "All pixels of the photo, in a file of its kind"),
    ("LEARNED", "Learned Size", "As small as what was learned from: quick, for a look"),
    ("PIXELS", "Long Side", "So many pixels at the longer side"),
]
RULE_ITEMS = [
    ("becomes", "Material", "Paint the whole object anew, light and highlights kept"),
    ("fewest", "Fewest swatches", "Reach the color with as few changed swatches as possible"),
]


def _edit_changed(self, context):
    recolor.refresh(self.id_data)


def _view_chosen(self, context):
    recolor.refresh(self.id_data)
    disk.refresh()


def _masks_chosen(self, context):
    disk.refresh()


def _format_chosen(self, context):
    if self.color_depth not in FORMAT_DEPTHS[self.file_format]:
        self.color_depth = "16"  # which both have


def _overlay_switched(self, context):
    reprojection.refresh(self.id_data)


def _project_chosen(self, context):
    # while a file is saved elsewhere, its new paths lead from the new place: here they lead anywhere
    if not folders.is_rebasing():
        palettes.import_learned(self.id_data)
        disk.refresh()


def srgb(name: str, default: float = 0.0, highest: float = 1.0, **options):
    """A color property of sRGB numbers, as palettes are learned; the picker's bar ends at white."""
    limits = {"min": 0.0, "max": highest, "soft_max": 1.0}
    return FloatVectorProperty(name=name, subtype="COLOR_GAMMA", size=3, default=(default,) * 3, **limits, **options)


class KARF_PG_swatch(bpy.types.PropertyGroup):
    """One palette color of an object: as learned, and as the artist wants it."""

    learned: srgb("Learned", description="The color that was found in the photos")
    color: srgb(
        "Color",
        highest=BRIGHTEST,
        description="The color it shall have; it may be brighter than white, which bright paint can need",
        update=_edit_changed,
    )
    locked: BoolProperty(name="Lock", description="'Becomes' leaves this swatch alone")


class KARF_PG_object(bpy.types.PropertyGroup):
    """One object of the masks. Its first swatch is black and stays black."""

    swatches: CollectionProperty(type=KARF_PG_swatch)
    source: srgb(
        "Source",
        0.5,
        description="A color of the object as it is in the photo, before any edit; pick it from the picture",
    )
    target: srgb("Target", 0.5, description="The color that the source shall become")
    rule: EnumProperty(name="Rule", items=RULE_ITEMS)
    show_becomes: BoolProperty(
        name="One color becomes another", description="Pick a color of the object and what it shall become"
    )


class KARF_PG_view(bpy.types.PropertyGroup):
    """A captured view, known by its name."""

    split: StringProperty(name="Split", description="train, val or test")


class KARF_PG_scene(bpy.types.PropertyGroup):
    """A scene's project, palettes and edits."""

    project: StringProperty(
        name="Project",
        subtype="DIR_PATH",
        options=PATH_OPTIONS,
        description="Folder of all that is learned; choosing one that has palettes brings its swatches",
        update=_project_chosen,
    )
    capture: StringProperty(name="Capture", subtype="FILE_PATH", options=PATH_OPTIONS, description="Cameras and photos")
    masks: StringProperty(
        name="Masks",
        subtype="DIR_PATH",
        options=PATH_OPTIONS,
        description="Folder with <object>/<photo name>.png, white where the object is",
        update=_masks_chosen,
    )
    out: StringProperty(
        name="Output",
        subtype="DIR_PATH",
        options=PATH_OPTIONS,
        description="Where pictures go; empty: out in the project",
    )
    frames: StringProperty(
        name="Frames",
        subtype="DIR_PATH",
        options=PATH_OPTIONS,
        description="Folder of the frames that were rendered last",
    )
    captured_size: EnumProperty(name="Size", items=SIZE_ITEMS, description="Of recolored photos")
    captured_pixels: IntProperty(
        name="Long Side", subtype="PIXEL", default=1024, min=16, max=65536, description="Of recolored photos"
    )
    file_format: EnumProperty(
        name="File Format", items=FORMAT_ITEMS, description="Of a camera's frames", update=_format_chosen
    )
    color_mode: EnumProperty(name="Color", items=MODE_ITEMS, description="Of a camera's frames")
    color_depth: EnumProperty(name="Color Depth", items=DEPTH_ITEMS, description="Of a camera's frames")
    skip_existing: BoolProperty(
        name="Skip Existing",
        default=True,
        description="Keep frames that are there already and would come out the same, and go on where a job was stopped",
    )
    preset: EnumProperty(name="Preset", items=PRESET_ITEMS, description="How long and how well to learn")
    nerf: StringProperty(
        name="Pretrained NeRF",
        subtype="FILE_PATH",
        options=PATH_OPTIONS,
        description="Checkpoint of a NeRF that another program has trained on this capture, taken as the geometry "
        "(nerf-pytorch, krrish94); empty: learn it",
    )
    compositing: EnumProperty(name="Compositing", items=COMPOSITING_ITEMS, update=_edit_changed)
    rig: PointerProperty(name="Rig", type=bpy.types.Object, description="The Empty that holds the captured cameras")
    views: CollectionProperty(type=KARF_PG_view)
    n_points: IntProperty(name="Points", description="Sparse points of the capture")
    show_reprojection: BoolProperty(
        name="Reprojection Errors",
        description="Over the photo looked through: lines from the sparse points to where the photo shows them, "
        "green where they agree, red from 4 pixels on",
        update=_overlay_switched,
    )
    active_view: StringProperty(name="View", description="The captured view that is shown", update=_view_chosen)
    objects: CollectionProperty(type=KARF_PG_object)
    result: PointerProperty(name="Result", type=bpy.types.Image, description="The recolored picture")
    mask_object: StringProperty(name="Object", description="Name of the object to mark", default="object")
    mask_view: StringProperty(name="Marked view", description="The view that the painted mask belongs to")
    mask_image: PointerProperty(name="Mask", type=bpy.types.Image, description="The photo that is painted on")


class KARF_PG_color(bpy.types.PropertyGroup):
    """One color of a sheet of colorways, and what it will be."""

    colorway: StringProperty()
    object: StringProperty()
    wanted: srgb("Wanted")
    reached: srgb("Reached")
    difference: FloatProperty(description="CIEDE2000 of the color reached to the wanted one")
    reason: StringProperty(description="Why the wanted color cannot be reached")


class KARF_PG_colorways(bpy.types.PropertyGroup):
    """The sheet of colorways that is looked at."""

    colors: CollectionProperty(type=KARF_PG_color)
    active: IntProperty()


class KARF_PG_progress(bpy.types.PropertyGroup):
    """The running job, and why the last one failed."""

    running: BoolProperty()
    stage: StringProperty()
    fraction: FloatProperty(min=0.0, max=1.0)
    text: StringProperty()
    figures: StringProperty()
    warnings: StringProperty(description="What the last task warned of, a line each")
    error: StringProperty()
    job: StringProperty(description="Folder of the failed job, where its log tells more of why")
    hint: StringProperty()


CLASSES = (
    KARF_PG_swatch,
    KARF_PG_object,
    KARF_PG_view,
    KARF_PG_scene,
    KARF_PG_color,
    KARF_PG_colorways,
    KARF_PG_progress,
)


def register():
    """Called when the extension is enabled."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.karf = PointerProperty(type=KARF_PG_scene)
    bpy.types.WindowManager.karf_progress = PointerProperty(type=KARF_PG_progress)
    bpy.types.WindowManager.karf_colorways = PointerProperty(type=KARF_PG_colorways)
    bpy.types.Object.karf_view = StringProperty(name="KaRF view", description="The captured view of this camera")


def unregister():
    """Called when the extension is disabled."""
    del bpy.types.Object.karf_view
    del bpy.types.WindowManager.karf_colorways
    del bpy.types.WindowManager.karf_progress
    del bpy.types.Scene.karf
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
