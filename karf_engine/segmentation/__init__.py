"""From coarse masks to clean labels on surface points."""
