"""Metrics of pictures and masks against a known truth."""
