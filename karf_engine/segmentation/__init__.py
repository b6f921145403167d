"""From coarse masks to clean labels on surface points, and to F_s; `marking` makes the masks."""
