"""The figure of LAENeRF's published script: to compare with papers that used it, not to trust."""

from __future__ import annotations

import numpy as np

from tools.metrics.consistency import forward_backward_consistent, optical_flow, sample_bilinear, warp_positions


def laenerf_error(first: np.ndarray, second: np.ndarray, shown: np.ndarray, other: np.ndarray) -> float:
    """What the script calls RMSE; arguments as for `tools.metrics.consistency.flow_rmse`.

    It is the mean, over pixels, of squares summed over channels, without a root; over the pixels that are hidden, not
    over those that are visible; and it tells these by one flow taken twice, so that all that moves by more than a third
    of a pixel counts as hidden. NaN where nothing moves.
    """
    to_first, to_second = optical_flow(second, first), optical_flow(first, second)
    hidden = ~forward_backward_consistent(
        to_second, sample_bilinear(to_second, warp_positions(to_first)).reshape(to_first.shape)
    )
    difference = other[hidden] - sample_bilinear(shown, warp_positions(to_first))[hidden.ravel()]
    return float((difference**2).sum(-1).mean()) if hidden.any() else float("nan")
