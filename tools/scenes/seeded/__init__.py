"""Scenes that a seed draws: nobody chose what is in them, so that no constant can be chosen to suit them.

scene (what there is) <- draw (a seed's choice of it); forms, surroundings (made in Blender); masks (of hasty hands);
recipe (a scene as a capture).
"""
