"""Blender's render engine KaRF: the recolored scene in rendered 3D Views, and from any camera as stills and animations."""
