"""The render engine as Blender knows it, and Blender's own panels that it is compatible with."""

import bpy

from .. import session
from ..engine_api import Cancelled, KarfError
from ..host.words import translate_error
from . import still
from .viewport import Viewport

NAME = "KARF"
# panels of BLENDER_RENDER, whose settings KaRF does not use
LEFT_OUT = {
    "RENDER_PT_simplify",
    "VIEWLAYER_PT_filter",
    "VIEWLAYER_PT_layer_passes",
    "SCENE_PT_audio",
    "WORLD_PT_context_world",
}


class KARF_RE_engine(bpy.types.RenderEngine):
    """Render the recolored scene from any camera"""

    bl_idname = NAME
    bl_label = "KaRF"
    bl_use_preview = False
    bl_use_eevee_viewport = True  # in Material Preview
    bl_use_shading_nodes_custom = False

    def update_render_passes(self, scene, renderlayer):
        self.register_pass(scene, renderlayer, still.COMBINED, 4, "RGBA", "COLOR")
        for each in still.passes_of(scene, renderlayer):
            self.register_pass(scene, renderlayer, each.name, len(each.channels), each.channels, each.kind)

    def render(self, depsgraph):
        try:
            still.render(self, depsgraph)
        except Cancelled:
            return
        except KarfError as error:
            self.error_set(translate_error(error))  # over the picture
            self.report({"ERROR"}, translate_error(error))  # to scripts, and at the mouse

    def view_update(self, context, depsgraph):
        self.tag_redraw()

    def view_draw(self, context, depsgraph):
        if not hasattr(self, "viewport"):
            self.viewport = Viewport()
        self.viewport.draw(self, context, depsgraph)
        self.update_stats("KaRF", self.viewport.message)


@session.setup
def _compatible_panels():
    known = (each for each in bpy.types.Panel.__subclasses__() if each.__name__ not in LEFT_OUT)
    panels = [each for each in known if "BLENDER_RENDER" in getattr(each, "COMPAT_ENGINES", ())]
    for panel in panels:
        panel.COMPAT_ENGINES.add(NAME)
    yield
    for panel in panels:
        panel.COMPAT_ENGINES.discard(NAME)
