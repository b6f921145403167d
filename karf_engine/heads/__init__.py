"""The two KaRF fields on top of a frozen radiance field, F_s and F_w: what they are, their training, their rendering."""
