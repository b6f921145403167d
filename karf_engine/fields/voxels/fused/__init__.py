"""Compiled kernels that learn and render a voxel field on the processor; they need numba."""
