"""Blender as the host: differences between its versions, translation, windows, and whether it renders."""
