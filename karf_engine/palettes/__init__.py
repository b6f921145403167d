"""Palettes and edits: extraction, matching, compositing, colorways."""
