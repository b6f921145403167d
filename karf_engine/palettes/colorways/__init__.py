"""Colorways: sheets of target colors, and predictions of the colors reached."""
