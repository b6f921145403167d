"""Splatting by compiled kernels: from a table of Gaussians to a picture, and from its gradient back to the table's."""
