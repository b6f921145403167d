"""Palettes, edits of them, and what becomes of a picture: extraction, matching, compositing, colorways."""
