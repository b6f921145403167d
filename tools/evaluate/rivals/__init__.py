"""The rules that others recolor by, rebuilt from their papers on our own field, masks and palettes' sizes.

They are re-implementations of a rule, not the authors' programs: each learns on the surface samples of the frozen field
instead of with a field of its own, in seconds instead of hours.
"""
