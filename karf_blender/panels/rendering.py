"""Step 7, Render: the pictures, and below them a group that can be opened for each other kind of result."""

import bpy

from ..host.words import translatable
from ..project import disk
from ..render_engine.engine import NAME
from ..surface import splat_objects
from .preview import draw_live
from .surface import draw_surface
from .views import draw_advanced, draw_space


def draw_render(layout, context):
    """Step 7: the pictures, whose buttons ask for all else in a dialog."""
    karf = context.scene.karf
    row = layout.row(align=True)
    row.prop(karf, "out")
    row.operator("karf.open_folder", text="", icon="FILEBROWSER").folder = "out"
    column = layout.column(align=True)
    column.operator("karf.render_view", text="This View", icon="IMAGE_DATA")
    column.operator("karf.render_capture", text="Captured Views", icon="RENDERLAYERS")
    column.operator("karf.render_camera", text="Camera's Frames", icon="RENDER_ANIMATION")
    for name, title, draw_group in GROUPS:
        header, body = layout.panel(f"karf_render_{name}", default_closed=name != "views")
        header.label(text=title)
        if body is not None:
            draw_group(body, karf)
    body = draw_advanced(layout, "render")
    if body is not None:
        body.operator("karf.farm_bundle", icon="NETWORK_DRIVE")


def draw_views(layout, karf):
    """The scene by Blender's own ways."""
    known = disk.contents_of(karf.id_data)
    column = layout.column(align=True)
    if "geometry" in known.stages and "splats" not in known.stages:
        column.operator("karf.learn_splats", icon="SHADERFX")
    column.operator("karf.rendered_view", icon="SHADING_RENDERED")
    column.prop(karf, "fade_unseen")
    column.operator("karf.over_scene", icon="MOD_BOOLEAN")
    column.operator("karf.export_splat", icon="EXPORT")
    is_followed = splat_objects.find(karf.id_data) is not None
    if is_followed or splat_objects.is_splat(bpy.context.object):
        column.operator("karf.follow_splat", icon="POINTCLOUD_DATA", depress=is_followed)


def draw_cameras(layout, karf):
    """A camera's path as a file."""
    row = layout.row(align=True)
    row.operator("karf.import_cameras", icon="IMPORT")
    row.operator("karf.export_cameras", icon="EXPORT")


def draw_sequence(layout, karf):
    """Where frames are once they are rendered."""
    row = layout.row(align=True)
    row.operator("karf.show_frames", icon="IMAGE_DATA")
    row.operator("karf.add_strip", icon="SEQUENCE")
    layout.operator("karf.open_folder", icon="FILEBROWSER").folder = "frames"


def draw_colorways(layout, karf):
    """A sheet of colors for objects, and the looks that were kept."""
    column = layout.column(align=True)
    column.operator("karf.colorways", icon="COLOR")
    column.operator("karf.render_looks", icon="RENDER_ANIMATION")


def draw_compositor(layout, karf):
    """Nodes with sockets of their own, or with sockets that follow the swatches."""
    column = layout.column(align=True)
    column.operator("karf.build_compositor", icon="NODETREE")
    column.operator("karf.build_compositor", text="Build, Follow Swatches", icon="DRIVER").driven = True
    body = draw_advanced(layout, "compositor")
    if body is not None:
        draw_space(body, karf, "layer_space")


# name, title, what it draws
GROUPS = (
    ("views", translatable("Any View"), draw_views),
    ("live", translatable("Live Camera"), draw_live),
    ("sequence", translatable("Rendered Frames"), draw_sequence),
    ("colorways", translatable("Colorways"), draw_colorways),
    ("surface", translatable("Scene in 3D"), draw_surface),
    ("compositor", translatable("Compositor"), draw_compositor),
    ("cameras", translatable("Camera Paths"), draw_cameras),
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
