"""The main job on the demo capture: run in Blender, judged against the truth; and how its capture was made."""
