"""The render engine as Blender knows it."""

import bpy

from ..engine_api import Cancelled, KarfError
from ..host.words import translate_error
from . import compatible, passes, still
from .viewport import Viewport


class KARF_RE_engine(bpy.types.RenderEngine):
    """Render the recolored scene from any camera"""

    bl_idname = compatible.NAME
    bl_label = "KaRF"
    bl_use_preview = False
    bl_use_eevee_viewport = True  # in Material Preview
    bl_use_shading_nodes_custom = False

    def update_render_passes(self, scene, renderlayer):
        """Tell Blender which passes a render has."""
        self.register_pass(scene, renderlayer, passes.COMBINED, 4, "RGBA", "COLOR")
        for each in passes.beside_combined(scene, renderlayer):
            self.register_pass(scene, renderlayer, each.name, len(each.channels), each.channels, each.kind)

    def update(self, data, depsgraph):
        """Before a render, on the main thread: nothing is to be made ready."""

    def render(self, depsgraph):
        """A still, or a frame of an animation."""
        try:
            still.render(self, depsgraph)
        except Cancelled:
            return
        except KarfError as error:
            self.error_set(translate_error(error))  # over the picture
            self.report({"ERROR"}, translate_error(error))  # to scripts, and at the mouse

    def view_update(self, context, depsgraph):
        """Something has changed: what is drawn next sees it."""
        self.tag_redraw()

    def view_draw(self, context, depsgraph):
        """Draw a rendered 3D View."""
        if not hasattr(self, "viewport"):
            self.viewport = Viewport()
        self.viewport.draw(self, context, depsgraph)
        self.update_stats("KaRF", self.viewport.message)
