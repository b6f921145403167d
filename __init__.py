"""KaRF as a Blender extension. Importing this imports nothing: Blender calls register(), tools read only the manifest."""


def register():
    """Called by Blender when the extension is enabled."""
    from . import karf_blender

    karf_blender.register()


def unregister():
    """Called by Blender when the extension is disabled."""
    from . import karf_blender

    karf_blender.unregister()
