"""Colorways: sheets of wanted colors, and what palettes reach of them."""
