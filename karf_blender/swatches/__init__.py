"""Swatches: learned palettes in the scene, edits of them, their keyframes, and the picture that they make."""
