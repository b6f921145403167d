"""A texture for testing optical flow."""

import numpy as np


def smooth_texture(shift: float) -> np.ndarray:
    """A wavy picture [64, 96, 3], moved right by `shift` pixels."""
    v, u = np.mgrid[:64, :96]
    waves = [np.sin((u - shift) / length + v / other) for length, other in ((5, 7), (4, -9), (7, 3))]
    return 0.5 + 0.2 * np.stack(waves, -1)
