"""Coarse masks to clean labels on surface points."""
