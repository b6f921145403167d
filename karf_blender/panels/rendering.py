"""Step 5: pictures, and a group for each other kind of result."""

import bpy

from .. import steps
from ..host.words import draw_text, translatable
from ..render_engine.engine import NAME
from ..steps import preview
from ..surface import scene_object, splat_objects
from ..swatches import outputs
from .display import draw_advanced, draw_space
from .splats import draw_splats


def draw_render(layout, context):
    """Draw step 5; the dialogs of its buttons ask for the rest."""
    karf = context.scene.karf
    layout.label(text=outputs.shown_path(karf.id_data), icon="FILE_IMAGE", translate=False)
    column = layout.column(align=True)
    column.operator("karf.render_view", text="This View", icon="IMAGE_DATA")
    column.operator("karf.render_looks", text="All Looks", icon="COLOR")
    column.operator("karf.render_capture", text="Captured Views", icon="RENDERLAYERS")
    body = draw_advanced(layout, "render")
    if body is None:
        return
    row = body.row(align=True)
    row.prop(karf, "out")
    row.operator("karf.open_folder", text="", icon="FILEBROWSER").folder = "out"
    body.prop(karf, "file_names", text="Names")  # the whole name does not fit
    body.operator("karf.render_camera", text="Camera's Frames", icon="RENDER_ANIMATION")
    for name, title, draw_group in GROUPS:
        header, group = body.panel(f"karf_render_{name}", default_closed=name != "views")
        header.label(text=title)
        if group is not None:
            draw_group(group, karf)
    body.operator("karf.farm_bundle", icon="NETWORK_DRIVE")


def _draw_views(layout, karf):
    draw_splats(layout, karf.id_data)
    column = layout.column(align=True)
    column.operator("karf.rendered_view", icon="SHADING_RENDERED")
    if karf.id_data.view_settings.view_transform not in steps.STANDARD:
        column.operator("karf.standard_colors", icon="COLOR")
    column.operator("karf.new_camera", icon="OUTLINER_OB_CAMERA")
    column.prop(karf, "fade_unseen")
    column.operator("karf.over_scene", icon="MOD_BOOLEAN")
    column.operator("karf.export_splat", icon="EXPORT")
    is_followed = splat_objects.find(karf.id_data) is not None
    if is_followed or splat_objects.is_splat(bpy.context.object):
        column.operator("karf.follow_splat", icon="POINTCLOUD_DATA", depress=is_followed)


def _draw_cameras(layout, karf):
    row = layout.row(align=True)
    row.operator("karf.import_cameras", icon="IMPORT")
    row.operator("karf.export_cameras", icon="EXPORT")


def _draw_sequence(layout, karf):
    row = layout.row(align=True)
    row.operator("karf.show_frames", icon="IMAGE_DATA")
    row.operator("karf.add_strip", icon="SEQUENCE")
    layout.operator("karf.open_folder", icon="FILEBROWSER").folder = "frames"


def _draw_colorways(layout, karf):
    column = layout.column(align=True)
    column.operator("karf.colorways", icon="COLOR")
    column.operator("karf.export_page", icon="URL")


def _draw_compositor(layout, karf):
    column = layout.column(align=True)
    column.operator("karf.build_compositor", icon="NODETREE")
    column.operator("karf.build_compositor", text="Build, Follow Swatches", icon="DRIVER").driven = True
    draw_space(layout, karf, "layer_space")


def _draw_live(layout, karf):
    is_live = preview.is_live()
    row = layout.row(align=True)
    row.operator("karf.live_camera", icon="PAUSE" if is_live else "PLAY", depress=is_live)
    row.prop(bpy.data.window_managers[0].karf_preview, "long_side", text="")
    if preview.message():
        draw_text(layout, preview.message(), "INFO")
    for sentence in preview.missing():
        draw_text(layout, sentence, "INFO")


def _draw_surface(layout, karf):
    row = layout.row(align=True)
    row.operator("karf.show_scene", icon="OUTLINER_OB_POINTCLOUD")
    row.prop(karf.surface, "count", text="")
    item = scene_object.find(karf.id_data)
    if item is None:
        return
    radius = scene_object.radius_node(item)
    if radius is not None:
        layout.prop(radius.outputs[0], "default_value", text="Radius")
    row = layout.row(align=True)
    row.operator("karf.show_colors", icon="SHADING_SOLID")
    row.operator("karf.export_scene", icon="EXPORT")


# name, title, what it draws
GROUPS = (
    ("views", translatable("New Views"), _draw_views),
    ("live", translatable("Live Camera"), _draw_live),
    ("sequence", translatable("Rendered Frames"), _draw_sequence),
    ("colorways", translatable("Colorways"), _draw_colorways),
    ("surface", translatable("Scene in 3D"), _draw_surface),
    ("compositor", translatable("Compositor"), _draw_compositor),
    ("cameras", translatable("Camera Paths"), _draw_cameras),
)


class KARF_PT_passes(bpy.types.Panel):
    """Passes written by the render engine KaRF"""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "view_layer"
    bl_label = "Passes"
    COMPAT_ENGINES = {NAME}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context):
        layout, layer = self.layout, context.view_layer
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(layer, "use_pass_z", text="Depth")
        layout.prop(layer.karf, "use_weights")
        layout.prop(layer.karf, "use_seen")
        layout.prop(layer, "use_pass_cryptomatte_object", text="Cryptomatte")
        column = layout.column()
        column.active = layer.use_pass_cryptomatte_object
        column.prop(layer, "pass_cryptomatte_depth", text="Levels")
