"""Radiance fields behind one protocol, with the rendering and the training beneath them."""
