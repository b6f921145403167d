"""Figures against a known truth, and of views against each other."""
