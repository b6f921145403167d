"""Fit an edit to wanted colors or to a painted picture."""
