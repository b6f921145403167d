"""The two KaRF fields on top of a frozen radiance field, F_s and F_w: their networks, training and rendering."""
