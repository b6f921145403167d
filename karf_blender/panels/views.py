"""The active view."""


def draw_view(layout, karf):
    """The choice of the active view."""
    layout.prop_search(karf, "active_view", karf, "views", text="", icon="CAMERA_DATA")
