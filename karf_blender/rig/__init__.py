"""Cameras: a capture as a rig of Blender cameras and points, and Blender cameras as cameras of the engine."""
