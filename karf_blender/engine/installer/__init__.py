"""The environment that the extension makes for the engine: uv fills it from lock files. No bpy."""
