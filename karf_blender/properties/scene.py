"""What the .blend keeps of a scene's project: Scene.karf."""

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

from ..engine_api import COMPOSITING_MODES, PRESETS
from ..host import windows
from ..host.compat import PATH_OPTIONS
from ..marking import asking, objects
from ..project import contents, disk, folders
from ..rig import reprojection
from ..swatches import displayed, palettes
from .colors import srgb
from .looks import KARF_PG_look
from .marking import KARF_PG_marking
from .surface import KARF_PG_surface
from .swatches import KARF_PG_match, KARF_PG_object, edit_changed
from .working import KARF_PG_looking

PRESET_HELP = {
    "demo": "For a first look: photos of 256 pixels, on any computer",
    "fast": "Photos of 400 pixels, on a laptop",
    "fine": "Photos of 400 pixels with voxels half as large, on a laptop with 8 GB of memory",
    "quality": "Photos of 800 pixels, on a graphics card",
    "paper": "The paper's own method and numbers, on a graphics card, for a long time",
}
PRESET_ITEMS = [(name, name.capitalize(), PRESET_HELP[name]) for name in PRESETS]
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
FORMAT_DEPTHS = {"PNG": ("8", "16"), "OPEN_EXR": ("16", "32")}  # depths that a format has
MODE_ITEMS = [("RGB", "RGB", "Opaque"), ("RGBA", "RGBA", "What is behind the scene is transparent")]
SIZE_ITEMS = [
    ("PHOTO", "Photo's Size", "All pixels of the photo, in a file of its kind"),
    ("LEARNED", "Learned Size", "As small as what was learned from: quick, for a look"),
    ("PIXELS", "Long Side", "So many pixels at the longer side"),
]


def _view_chosen(self, context):
    displayed.of(self.id_data).refresh()
    asking.follow(self.id_data)
    disk.refresh()


def _masks_chosen(self, context):
    if not folders.is_rebasing() and self.project:
        objects.sync(self.id_data)
    disk.refresh()


def _format_chosen(self, context):
    if self.color_depth not in FORMAT_DEPTHS[self.file_format]:
        self.color_depth = "16"  # which both have


def _fading_chosen(self, context):
    windows.redraw("VIEW_3D")


def _overlay_switched(self, context):
    reprojection.refresh(self.id_data)


def _project_chosen(self, context):
    # while a file is saved elsewhere, its new paths lead from the new place: here they lead anywhere
    if not folders.is_rebasing():
        palettes.import_learned(self.id_data)
        preset, _ = contents.learned_with(self.id_data)
        if preset in PRESETS:
            self.preset = preset
        if self.project:
            objects.restart(self.id_data)
        disk.refresh()


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
    stays_hidden: BoolProperty(description="The project shall not move beside the file: it was asked")
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
    fade_unseen: BoolProperty(
        name="Fade Unseen",
        default=True,
        description="What no photo shows, or only from elsewhere, turns gray in the rendered 3D View and in cameras' frames. Off: "
        "whatever the splats hold there",
        update=_fading_chosen,
    )
    preset: EnumProperty(name="Preset", items=PRESET_ITEMS, description="How long and how well to learn")
    nerf: StringProperty(
        name="Pretrained NeRF",
        subtype="FILE_PATH",
        options=PATH_OPTIONS,
        description="Checkpoint of a NeRF that another program has trained on this capture, taken as the geometry "
        "(nerf-pytorch, krrish94); empty: learn it",
    )
    photo_space: StringProperty(
        name="Photo Space",
        description="Color space that the photos' files are in, by its OpenColorIO name, as ACEScg; recolored photos are "
        "written in it. Empty: sRGB, of OpenEXR linear light. The engine needs its extra color",
    )
    layer_space: StringProperty(
        name="Layer Space",
        description="Color space of the layers' picture, by its OpenColorIO name, as ACEScg. Empty: linear Rec. 709. The "
        "engine needs its extra color",
    )
    ocio: StringProperty(
        name="Color Config",
        subtype="FILE_PATH",
        options=PATH_OPTIONS,
        description="OpenColorIO configuration of these spaces, config.ocio. Empty: that of the variable OCIO, else the "
        "engine's own",
    )
    card: srgb(
        "Gray Card",
        description="What a gray card (L* 50, 18 %) looks like in the photos; pick it in the picture (E). Names and numbers "
        "of colors are then those under daylight. Black: no card",
    )
    chart: FloatVectorProperty(
        size=9, description="From linear light under daylight to that in the photos, by a color chart; zeros: no chart"
    )
    chart_left: FloatProperty(description="CIEDE2000 that the chart's patches are off in the mean")
    material: BoolProperty(
        name="Material",
        default=True,
        description="The other colors of a paint follow the swatch that is dragged: shades, pale and dark ones, while "
        "highlights keep the light's color. Off: each swatch moves by itself",
    )
    compositing: EnumProperty(name="Compositing", items=COMPOSITING_ITEMS, update=edit_changed)
    rig: PointerProperty(name="Rig", type=bpy.types.Object, description="The Empty that holds the captured cameras")
    views: CollectionProperty(type=KARF_PG_view)
    holdout: IntProperty(
        name="Keep for Testing",
        default=-1,
        description="Every how many-th photo is not learned from; -1: as was learned",
    )
    looking: PointerProperty(type=KARF_PG_looking)
    n_points: IntProperty(name="Points", description="Sparse points of the capture")
    show_reprojection: BoolProperty(
        name="Reprojection Errors",
        description="Over the photo looked through: lines from the sparse points to where the photo shows them, "
        "green where they agree, red from 4 pixels on",
        update=_overlay_switched,
    )
    advice: StringProperty(description="What the engine says of the capture, a line each; empty: it was not checked")
    is_poor: BoolProperty(description="Whether the engine advises to take more photos before it is learned")
    active_view: StringProperty(name="View", description="The captured view that is shown", update=_view_chosen)
    objects: CollectionProperty(type=KARF_PG_object)
    looks: CollectionProperty(type=KARF_PG_look)
    look: StringProperty(name="Look", description="The look in use; empty: none")
    look_before: StringProperty(description="The look that was in use before, to flip back to")
    surface: PointerProperty(type=KARF_PG_surface)
    match: PointerProperty(type=KARF_PG_match)
    result: PointerProperty(name="Result", type=bpy.types.Image, description="The recolored picture")
    marking: PointerProperty(type=KARF_PG_marking)
