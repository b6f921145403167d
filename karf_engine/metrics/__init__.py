"""Metrics of pictures, masks and edits against a known truth, and of views against each other."""
