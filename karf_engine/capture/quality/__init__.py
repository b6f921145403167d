"""Estimate the quality of a capture from photos, cameras and masks before training, in seconds."""
