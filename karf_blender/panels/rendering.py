"""Step 7, Render: what pictures share, and below it a group that can be closed for each kind of result."""

from ..properties.scene import FORMAT_DEPTHS
from .surface import draw_surface


def draw_render(layout, context):
    """Step 7."""
    karf = context.scene.karf
    layout.prop(karf, "out")
    layout.prop(karf, "skip_existing")
    for name, title, draw_group, is_closed in GROUPS:
        header, body = layout.panel(f"karf_render_{name}", default_closed=is_closed)
        header.label(text=title)
        if body is not None:
            draw_group(body, karf)


def draw_photos(layout, karf):
    """Captured views, and how large they are written."""
    column = layout.column(align=True)
    column.operator("karf.render_view", icon="IMAGE_DATA")
    column.operator("karf.render_capture", icon="RENDERLAYERS")
    row = layout.row(align=True)
    row.prop(karf, "captured_size", text="")
    if karf.captured_size == "PIXELS":
        row.prop(karf, "captured_pixels", text="")


def draw_camera(layout, karf):
    """A camera's frames, how they are written, as in Blender's output panel, and its path as a file."""
    layout.operator("karf.render_camera", icon="RENDER_ANIMATION")
    layout.prop(karf, "file_format", text="")
    layout.row(align=True).prop(karf, "color_mode", expand=True)
    row = layout.row(align=True)
    for depth in FORMAT_DEPTHS[karf.file_format]:
        row.prop_enum(karf, "color_depth", depth)
    layout.operator("karf.farm_bundle", icon="NETWORK_DRIVE")
    row = layout.row(align=True)
    row.operator("karf.import_cameras", icon="IMPORT")
    row.operator("karf.export_cameras", icon="EXPORT")


def draw_sequence(layout, karf):
    """Where frames are once they are rendered."""
    row = layout.row(align=True)
    row.operator("karf.show_frames", icon="IMAGE_DATA")
    row.operator("karf.add_strip", icon="SEQUENCE")


def draw_colorways(layout, karf):
    """A sheet of colors for objects."""
    layout.operator("karf.colorways", icon="COLOR")


def draw_compositor(layout, karf):
    """Nodes with sockets of their own, or with sockets that follow the swatches."""
    column = layout.column(align=True)
    column.operator("karf.build_compositor", icon="NODETREE")
    column.operator("karf.build_compositor", text="Build, Follow Swatches", icon="DRIVER").driven = True


# name, title, what it draws, whether it is closed at first
GROUPS = (
    ("photos", "Photos", draw_photos, False),
    ("camera", "Camera", draw_camera, True),
    ("sequence", "Rendered Frames", draw_sequence, True),
    ("colorways", "Colorways", draw_colorways, True),
    ("surface", "Scene in 3D", draw_surface, True),
    ("compositor", "Compositor", draw_compositor, True),
)
