"""Blender's render engine KaRF: the recolored scene in rendered 3D Views, and from any camera as stills and animations.

Pixels are made by the engine's process; here they are asked for, and handed to Blender.
"""
