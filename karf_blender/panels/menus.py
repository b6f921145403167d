"""What the extension adds to Blender's menus Import and Export."""

import bpy

from .. import session
from . import sidebar, swatching


def _draw_import(self, context):
    self.layout.operator("karf.import_splat", text="Gaussian Splat (KaRF)")


def _draw_export(self, context):
    self.layout.operator("karf.export_splat", text="Gaussian Splat (KaRF)")


@session.setup
def _menus():
    added = (
        (bpy.types.TOPBAR_MT_file_import, _draw_import),
        (bpy.types.TOPBAR_MT_file_export, _draw_export),
        (bpy.types.UI_MT_button_context_menu, swatching.draw_context_menu),
        (bpy.types.TOPBAR_MT_window, sidebar.draw_in_window_menu),
    )
    for menu, draw in added:
        menu.append(draw)
    yield
    for menu, draw in added:
        menu.remove(draw)
