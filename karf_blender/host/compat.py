"""What differs between Blender versions, and nothing else; the only file that asks for the version."""

import bpy

BLENDER = bpy.app.version_string

# properties that hold paths must say since 4.5 that `//` is understood; before, the word is unknown
PATH_OPTIONS = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else set()

# points of a size have had a shader of their own since 4.5
POINT_SHADER = "POINT_FLAT_COLOR" if bpy.app.version >= (4, 5, 0) else "FLAT_COLOR"


def exit_handlers() -> list | None:
    """The handlers called when Blender quits (5.1 and later), or None; the engine also notices when Blender is gone."""
    return getattr(bpy.app.handlers, "exit_pre", None)


def give_nodes(material: bpy.types.Material) -> None:
    """Let a new material have nodes; since 5.0 all have."""
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True


def curves_of(owner: bpy.types.AnimData | bpy.types.NlaStrip) -> list[bpy.types.FCurve]:
    """The curves with which animation data, or an NLA strip, animates; actions have slots and layers since 4.4."""
    if owner.action is None:
        return []
    if bpy.app.version < (4, 4, 0):
        return list(owner.action.fcurves)
    strips = [strip for layer in owner.action.layers for strip in layer.strips]
    bags = [bag for strip in strips for bag in strip.channelbags if bag.slot == owner.action_slot]
    return [curve for bag in bags for curve in bag.fcurves]


def set_brush_color(tool_settings: bpy.types.ToolSettings, color: tuple[float, float, float]) -> None:
    """Give the image paint brush this color; the unified color overrides it, and moved to the paint mode in 5.0."""
    paint = tool_settings.image_paint
    for owner in (paint, tool_settings):
        unified = getattr(owner, "unified_paint_settings", None)
        if unified is not None:
            unified.color = color
            break
    # brushes are assets since 4.3: there may be none before the first stroke
    if paint.brush is not None:
        paint.brush.color = color


# --- the sequencer, whose strips are called strips since 4.4 ---------------------------------------------------------
def strips_of(scene: bpy.types.Scene) -> bpy.types.bpy_prop_collection:
    """The strips of the scene's sequencer, which is made where there is none."""
    editor = scene.sequence_editor or scene.sequence_editor_create()
    return editor.sequences if bpy.app.version < (4, 4, 0) else editor.strips
