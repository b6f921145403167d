"""Compiled kernels that train and render voxel fields on the processor; they need numba."""
