"""Labels of surface points: what each is, how clearly, and how far opinions of it differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Labels:
    """Labels of p surface points.

    Attributes:
        probabilities: [p, K+1]; rows sum to 1.
        precision: [K] in [0, 1], of the seeds whose color looks like an object, the share that the masks label so.
        opinion: [p, K+1]; rows sum to 1: the mean of what masks and neighbors, colors, and all together suggest.
    """

    probabilities: np.ndarray
    precision: np.ndarray
    opinion: np.ndarray

    @property
    def classes(self) -> np.ndarray:
        """Most likely class of each point, [p] int."""
        return self.probabilities.argmax(1)

    @property
    def margin(self) -> np.ndarray:
        """How much more likely each point's class is than the next, [p] in [0, 1]."""
        return margin(self.probabilities)

    @property
    def doubt(self) -> np.ndarray:
        """How far the opinions contradict the labels of each object, [p, K] in [0, 1].

        A label is mistaken most often where masks alone, or colors alone, would have given another label.
        """
        is_it = self.classes[:, None] == np.arange(1, self.opinion.shape[1])
        return np.where(is_it, 1 - self.opinion[:, 1:], self.opinion[:, 1:])


def margin(x: np.ndarray) -> np.ndarray:
    """How much more likely each point's class is than the next, [p] in [0, 1]."""
    top_two = np.sort(x, 1)[:, -2:]
    return top_two[:, 1] - top_two[:, 0]
