"""What several steps draw: the active view, and what few need."""


def draw_view(layout, karf):
    """The choice of the active view."""
    layout.prop_search(karf, "active_view", karf, "views", text="", icon="CAMERA_DATA")


def draw_space(layout, karf, name):
    """A color space by its name, and the configuration that knows it."""
    column = layout.column(align=True)
    for each in (name, "ocio"):
        column.label(text=karf.bl_rna.properties[each].name)  # above: beside the field a sidebar cuts it off
        column.prop(karf, each, text="")


def draw_advanced(layout, step):
    """The body of a step's folded group for what few need, or whose words are those of the field; None while folded."""
    header, body = layout.panel(f"karf_{step}_advanced", default_closed=True)
    header.label(text="Advanced")
    return body
