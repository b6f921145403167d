"""Scenes that a seed draws: nobody chose what is in them, so that no constant can be chosen to suit them.

scene (what there is) <- draw (a seed's choice of it); forms, surroundings (made in Blender); masks (of hasty hands);
recipe (a scene as a capture). Seeds 0 to 7 are for work. Seeds 100 to 109 are for reports: they are run when work has
ended, and what they say is printed whatever it is.

thin_draw and thin_forms do the same for things with thin parts on purpose: seeds 0 to 3 for work, 10 to 13 for reports.
"""
