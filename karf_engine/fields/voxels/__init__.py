"""A radiance field on a sparse grid of voxels, and its fits."""
