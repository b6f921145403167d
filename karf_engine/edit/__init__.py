"""Editing learned palettes: files, compositing, color science, metrics and color matching; stdlib and numpy only."""
