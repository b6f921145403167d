"""Recoloring in Blender's own compositor: node groups that need neither the extension nor the engine once built."""
