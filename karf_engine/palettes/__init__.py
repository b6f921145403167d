"""Editing learned palettes: their files, compositing of edited pictures, and "becomes"; stdlib and numpy only."""
