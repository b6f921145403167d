"""Radiance field on a sparse voxel grid, and its training."""
