"""The KaRF tab of the sidebar, in the 3D View and in the Image Editor. Drawing only reads."""

import bpy

from . import color_names, looks, marking, menus, rendering, seeing, sidebar, status, swatching

CLASSES = (
    *marking.CLASSES,
    *status.CLASSES,
    *seeing.CLASSES,
    *color_names.CLASSES,
    *swatching.CLASSES,
    *looks.CLASSES,
    *sidebar.CLASSES,
    *rendering.CLASSES,
)


def register():
    """Called when the extension is enabled."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.UI_MT_button_context_menu.append(swatching.draw_context_menu)
    bpy.types.TOPBAR_MT_window.append(sidebar.draw_in_window_menu)
    menus.register()
    sidebar.register()
    seeing.register_keys()


def unregister():
    """Called when the extension is disabled."""
    sidebar.unregister()
    menus.unregister()
    bpy.types.TOPBAR_MT_window.remove(sidebar.draw_in_window_menu)
    bpy.types.UI_MT_button_context_menu.remove(swatching.draw_context_menu)
    seeing.unregister_keys()
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
