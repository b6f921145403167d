"""File access: atomic writes, input checks, names, images and color conversion."""
