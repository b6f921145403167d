"""The steps from capture to picture as panels, the same in both editors."""

import textwrap

import bpy

from .. import recolor

LINE = 44  # characters of a message that fit the sidebar's usual width


def draw_status(layout, context):
    """The running job, or why the last one failed."""
    progress = context.window_manager.karf_progress
    if progress.running:
        row = layout.row(align=True)
        row.progress(factor=progress.fraction, text=f"{progress.stage}: {progress.text}")
        row.operator("karf.cancel", text="", icon="CANCEL")
    if progress.warnings:
        draw_text(layout.box(), progress.warnings, "INFO")
    if progress.error:
        box = layout.box()
        box.alert = True
        draw_text(box, progress.error, "ERROR")
        draw_text(box, progress.hint, "INFO")


def draw_text(layout, text, icon):
    """A long message as labels."""
    column = layout.column(align=True)
    for paragraph in text.splitlines():
        for line in textwrap.wrap(paragraph, LINE):
            column.label(text=line, icon=icon)
            icon = "BLANK1"


def draw_capture(layout, context):
    """Steps 1 and 2."""
    karf = context.scene.karf
    layout.operator("karf.import_capture", icon="CAMERA_DATA")
    if karf.project:
        layout.prop(karf, "project")
        row = layout.row(align=True)
        row.prop_search(karf, "active_view", karf, "views", text="", icon="CAMERA_DATA")
        row.operator("karf.look_through", text="", icon="VIEW_CAMERA")
        chosen = karf.views.get(karf.active_view)
        if chosen and chosen.split != "train":
            layout.label(text=f"A {chosen.split} view: not learned from", icon="INFO")
        layout.prop(karf, "preset")
    layout.operator("karf.learn_scene", icon="OUTLINER_OB_VOLUME")


def draw_objects(layout, context):
    """Steps 3 and 4."""
    karf = context.scene.karf
    layout.prop(karf, "masks")
    row = layout.row(align=True)
    row.prop(karf, "mask_object", text="")
    row.operator("karf.paint_mask", icon="BRUSH_DATA")
    row.operator("karf.save_mask", text="", icon="CHECKMARK")
    if karf.mask_image:
        layout.label(text=f"Painting {karf.mask_object} on {karf.mask_view}", icon="IMAGE_DATA")
    layout.operator("karf.segment", icon="MOD_MASK")


def draw_palette(layout, context):
    """Steps 5 and 6."""
    karf = context.scene.karf
    layout.operator("karf.extract_palette", icon="COLOR")
    for item in karf.objects:
        draw_object(layout.box(), item)
    if not karf.objects:
        return
    layout.prop(karf, "compositing")
    row = layout.row(align=True)
    row.prop_search(karf, "active_view", karf, "views", text="", icon="CAMERA_DATA")
    row.operator("karf.show_view", icon="IMAGE_DATA")
    if not recolor.is_prepared(context.scene):
        layout.label(text="Press Show View: not prepared yet", icon="INFO")
    layout.operator("karf.prepare_views", icon="RENDERLAYERS")
    row = layout.row(align=True)
    row.operator("karf.load_edit", icon="FILE_FOLDER")
    row.operator("karf.save_edit", icon="FILE_TICK")


def draw_object(layout, item):
    """An object's swatches, and what its color shall become."""
    row = layout.row()
    row.label(text=item.name, icon="OBJECT_DATA")
    row.operator("karf.reset_swatch", text="", icon="LOOP_BACK").object_name = item.name
    column = layout.column(align=True)
    for index, swatch in enumerate(item.swatches):
        if index:  # black is frozen
            draw_swatch(column.row(align=True), item, index, swatch)
    row = layout.row(align=True)
    row.prop(item, "source", text="")
    row.label(text="", icon="FORWARD")
    row.prop(item, "target", text="")
    row = layout.row(align=True)
    row.prop(item, "rule", text="")
    row.operator("karf.becomes").object_name = item.name


def draw_swatch(row, item, index, swatch):
    """One swatch: as learned, as it shall be, reset and lock."""
    learned = row.row(align=True)
    learned.enabled = False
    learned.scale_x = 0.4
    learned.prop(swatch, "learned", text="")
    row.prop(swatch, "color", text="")
    if swatch.color != swatch.learned:
        reset = row.operator("karf.reset_swatch", text="", icon="LOOP_BACK")
        reset.object_name, reset.index = item.name, index
    row.prop(swatch, "locked", text="", icon="LOCKED" if swatch.locked else "UNLOCKED")


def draw_render(layout, context):
    """Step 7."""
    layout.prop(context.scene.karf, "out")
    column = layout.column(align=True)
    column.operator("karf.render_view", icon="IMAGE_DATA")
    column.operator("karf.render_capture", icon="RENDERLAYERS")
    column.operator("karf.render_camera", icon="RENDER_ANIMATION")


# name, title, what it draws
SECTIONS = (
    ("status", "KaRF", draw_status),
    ("capture", "Capture", draw_capture),
    ("objects", "Objects", draw_objects),
    ("palette", "Palette", draw_palette),
    ("render", "Render", draw_render),
)
EDITORS = (("VIEW_3D", "view3d"), ("IMAGE_EDITOR", "image"))


def make_panel(space: str, editor: str, order: int, name: str, title: str, draw_section) -> type:
    """A panel class of one section in one editor."""

    def draw(self, context):
        draw_section(self.layout, context)

    return type(
        f"KARF_PT_{editor}_{name}",
        (bpy.types.Panel,),
        {
            "bl_space_type": space,
            "bl_region_type": "UI",
            "bl_category": "KaRF",
            "bl_label": title,
            "bl_order": order,
            "bl_options": {"HIDE_HEADER"} if name == "status" else set(),
            "draw": draw,
        },
    )


CLASSES = tuple(
    make_panel(space, editor, order, *section) for space, editor in EDITORS for order, section in enumerate(SECTIONS)
)
