"""Radiance fields behind one protocol, with their rendering and training."""
