"""The learned scene in the 3D View."""

from ..surface import scene_object


def draw_surface(layout, karf):
    """How many points, and what can be done with them once they are there."""
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
