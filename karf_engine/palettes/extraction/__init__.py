"""Palettes from photos: a simplified color hull per object, and palette weights as a function of color."""
