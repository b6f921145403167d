"""Captures with known truth, made with Cycles: what the demo's maker and the benchmark's share.

materials, shapes -> things (pot, apple ...) -> a recipe (which things, cameras and edits) -> photos, labels, depth,
true recolors and rough masks on disk. Needs the bpy wheel, numpy and imageio. All is procedural and seeded: the
same arguments give the same files.

Naming: z is up; lengths are scene units (read them as metres); base colors are scene linear. Pixel corners lie at
integers, pixel centers at +0.5; camera_to_world matrices use Blender axes (x right, y up, looks down -z). A label image
holds one object id per pixel, seen through the pixel center.
"""
