"""Radiance fields behind one protocol."""
