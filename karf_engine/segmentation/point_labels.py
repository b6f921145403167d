"""Class probabilities of surface points, with their margin and doubt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Labels:
    """Labels of p surface points.

    Attributes:
        probabilities: [p, K+1]; rows sum to 1.
        precision: [K] in [0, 1], share of the seeds of an object's color that the masks assign to the object.
        opinion: [p, K+1], mean of the labels from masks, from colors and from both; rows sum to 1.
    """

    probabilities: np.ndarray
    precision: np.ndarray
    opinion: np.ndarray

    @property
    def classes(self) -> np.ndarray:
        """The likeliest class of each point, [p] int."""
        return self.probabilities.argmax(1)

    @property
    def margin(self) -> np.ndarray:
        """The difference between the two largest probabilities of each point, [p] in [0, 1]."""
        return margin(self.probabilities)

    @property
    def doubt(self) -> np.ndarray:
        """The disagreement of `opinion` with the labels, [p, K] in [0, 1]: wrong labels are likeliest where it is high."""
        is_it = self.classes[:, None] == np.arange(1, self.opinion.shape[1])
        return np.where(is_it, 1 - self.opinion[:, 1:], self.opinion[:, 1:])


def margin(x: np.ndarray) -> np.ndarray:
    """Return the difference between the two largest values of each row, [p]."""
    top_two = np.sort(x, 1)[:, -2:]
    return top_two[:, 1] - top_two[:, 0]
