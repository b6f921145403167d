"""Extract palettes from photos: simplified color hulls, and palette weights as a function of color."""
