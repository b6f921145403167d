"""What the extension adds to Blender's menus Import and Export."""

import bpy


def register():
    """Called when the extension is enabled."""
    bpy.types.TOPBAR_MT_file_import.append(_draw_import)
    bpy.types.TOPBAR_MT_file_export.append(_draw_export)


def unregister():
    """Called when the extension is disabled."""
    bpy.types.TOPBAR_MT_file_export.remove(_draw_export)
    bpy.types.TOPBAR_MT_file_import.remove(_draw_import)


def _draw_import(self, context):
    self.layout.operator("karf.import_splat", text="Gaussian Splat (KaRF)")


def _draw_export(self, context):
    self.layout.operator("karf.export_splat", text="Gaussian Splat (KaRF)")
