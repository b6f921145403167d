"""What a script need not say."""

import bpy


def scene_of(scene: bpy.types.Scene | None) -> bpy.types.Scene:
    """The scene, by default the context's."""
    return scene or bpy.context.scene
