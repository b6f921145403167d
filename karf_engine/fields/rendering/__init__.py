"""Rays, sampling and volume rendering as functions of tensors."""
