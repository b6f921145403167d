"""Fits of an edit to a wanted color, to several, or to a painted picture."""
