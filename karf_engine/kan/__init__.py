"""Kolmogorov-Arnold heads: Gaussian, B-spline and plain layers, and the gated block made of them."""
