"""Metrics of recolored pictures that the benchmark and the judges use."""
