"""The environment that the extension makes for the engine: uv fills it from lock files. No bpy.

A `plan` says what would be done, an `Installation` does it, `home` knows what is in the folder.
"""
