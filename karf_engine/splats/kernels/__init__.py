"""Compiled kernels of Gaussian splatting: projection, tiles, blending, and their gradients."""
