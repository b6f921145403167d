"""Captured cameras and points in Blender, and Blender cameras as cameras of the engine."""
