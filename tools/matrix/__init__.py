"""The tests on other versions of Blender, Python and packages than those of `requirements/`."""
