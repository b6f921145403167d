"""The steps from capture to picture as panels in their order, the same in both editors.

A step that is done has a check mark in its header. A step that waits for another is greyed out, and its tooltip says
for which.
"""

import bpy

from ... import __package__ as extension
from ..engine import installing
from ..host.labels import draw_text
from ..pictures import chips
from ..preferences import state
from ..project import disk
from ..rig import reprojection
from . import rendering
from .status import draw_status, has_status


# --- steps 1 to 5: what is learned ---------------------------------------------------------------------------------
def draw_import(layout, context):
    """Step 1; where nothing is imported yet, it also says what is missing to go on."""
    karf = context.scene.karf
    if not karf.project:
        draw_engine(layout)
    layout.operator("karf.import_capture", icon="IMPORT")
    layout.operator("karf.find_poses", icon="CON_CAMERASOLVER")
    if not karf.project:
        return
    row = layout.row(align=True)
    draw_view(row, karf)
    row.operator("karf.look_through", text="", icon="VIEW_CAMERA")
    n_train = sum(view.split == "train" for view in karf.views)
    layout.label(text=f"{len(karf.views)} photos: {n_train} to learn, {len(karf.views) - n_train} to test")
    draw_reprojection(layout, context.scene)
    layout.prop(karf, "project")


def draw_reprojection(layout, scene):
    """The sparse points, and how far they are from where the photo that is looked through shows them."""
    if not scene.karf.n_points:
        layout.label(text="No sparse points to check cameras by")
        return
    layout.prop(scene.karf, "show_reprojection")
    known = reprojection.of_camera(scene, scene.camera)
    if known is None:
        layout.label(text="Look through a view to see its errors")
    elif not known.summary.count:
        layout.label(text="No point is known to be in this photo")
    else:
        draw_text(layout, str(known.summary), "BLANK1")


def draw_view(layout, karf):
    """The choice of the active view."""
    layout.prop_search(karf, "active_view", karf, "views", text="", icon="CAMERA_DATA")


def draw_learn(layout, context):
    """Step 2."""
    layout.prop(context.scene.karf, "preset")
    layout.prop(context.scene.karf, "nerf", text="NeRF")  # the whole name does not fit
    if context.scene.karf.project:
        draw_engine(layout)
    layout.operator("karf.learn_scene", icon="OUTLINER_OB_VOLUME")


def draw_engine(layout):
    """The way to an engine where there is none, or what is happening to it."""
    problem = state.known().problem
    if installing.is_running():
        progress = installing.progress()
        layout.progress(factor=progress.fraction, text=f"Engine: {progress.title}")
    elif problem:
        draw_text(layout, problem, "INFO")
    if problem or installing.is_running():
        layout.operator("preferences.addon_show", text="KaRF Preferences", icon="PREFERENCES").module = extension


def draw_masks(layout, context):
    """Step 3."""
    karf = context.scene.karf
    layout.prop(karf, "mask_object")
    draw_view(layout, karf)
    row = layout.row(align=True)
    row.operator("karf.paint_mask", icon="BRUSH_DATA")
    row.operator("karf.save_mask", icon="CHECKMARK")
    if karf.mask_image:
        layout.label(text=f"Painting {karf.mask_object} on {karf.mask_view}", icon="IMAGE_DATA")
    layout.prop(karf, "masks")
    counts = disk.contents_of(context.scene).masks
    if counts:
        # a space that does not break keeps a name and its number of masks together
        draw_text(layout, ", ".join(f"{name}\u00a0({count})" for name, count in counts.items()), "CHECKMARK")


def draw_segment(layout, context):
    """Step 4."""
    layout.operator("karf.segment", icon="MOD_MASK")


def draw_palette(layout, context):
    """Step 5."""
    layout.operator("karf.extract_palette", icon="COLOR")


# --- step 6: swatches ----------------------------------------------------------------------------------------------
def draw_edit(layout, context):
    """Step 6."""
    karf = context.scene.karf
    if not karf.objects:
        layout.label(text="Swatches appear after step 5", icon="INFO")
        return
    row = layout.row(align=True)
    draw_view(row, karf)
    is_prepared = disk.contents_of(context.scene).is_prepared
    row.operator("karf.show_view", text="Show" if is_prepared else "Prepare", icon="IMAGE_DATA")
    if not is_prepared:
        draw_text(layout, f"{karf.active_view} is not prepared: Prepare shows it recolored", "INFO")
    if not any(area.type == "IMAGE_EDITOR" for area in context.screen.areas):
        layout.label(text="Open an Image Editor to see it", icon="INFO")
    for item in karf.objects:
        draw_object(layout.box(), item)
    layout.prop(karf, "compositing", text="Result")
    row = layout.row(align=True)
    row.operator("karf.load_edit", icon="FILE_FOLDER")
    row.operator("karf.save_edit", icon="FILE_TICK")
    layout.operator("karf.prepare_views", icon="RENDERLAYERS")


def draw_object(layout, item):
    """An object's swatches side by side, and what one of its colors shall become."""
    row = layout.row()
    row.label(text=item.name, icon="OBJECT_DATA")
    row.operator("karf.reset_swatch", text="Reset", icon="LOOP_BACK").object_name = item.name
    row = layout.row(align=True)
    for index, swatch in enumerate(item.swatches):
        if index:  # black is frozen
            draw_swatch(row.column(align=True), item, index, swatch)
    row = layout.row()
    row.alignment = "LEFT"
    row.prop(item, "show_becomes", icon="DOWNARROW_HLT" if item.show_becomes else "RIGHTARROW", emboss=False)
    if item.show_becomes:
        draw_becomes(layout, item)


def draw_swatch(column, item, index, swatch):
    """One swatch: above as learned (a click gives it back), below as it shall be, and its lock."""
    learned = column.operator("karf.reset_swatch", text="", icon_value=chips.icon(swatch.learned))
    learned.object_name, learned.index = item.name, index
    edited = column.row(align=True)
    edited.scale_y = 2.0
    edited.prop(swatch, "color", text="")
    if item.show_becomes:
        column.prop(swatch, "locked", text="", icon="LOCKED" if swatch.locked else "UNLOCKED")


def draw_becomes(layout, item):
    """The pair of colors, the rule and the button."""
    row = layout.row(align=True)
    row.prop(item, "source", text="")
    row.label(text="", icon="FORWARD")
    row.prop(item, "target", text="")
    row = layout.row(align=True)
    row.prop(item, "rule", text="")
    row.operator("karf.becomes", text="Apply").object_name = item.name


# --- the panels ----------------------------------------------------------------------------------------------------
def has_stage(stage):
    """Whether the engine's stage is done, as a question to a scene."""
    return lambda scene: stage in disk.contents_of(scene).stages


def never(scene):
    """For steps that have no end."""
    return False


# name, title, what it draws, whether it is done while its project is there
SECTIONS = (
    ("status", "Status", draw_status, never),
    ("import", "1  Import", draw_import, lambda scene: bool(scene.karf.project)),
    ("learn", "2  Learn Scene", draw_learn, has_stage("geometry")),
    ("mark", "3  Mark Objects", draw_masks, lambda scene: bool(disk.contents_of(scene).masks)),
    ("segment", "4  Segment", draw_segment, has_stage("segmentation")),
    ("palette", "5  Palette", draw_palette, lambda scene: bool(scene.karf.objects)),
    ("edit", "6  Edit", draw_edit, never),
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
