"""Example labels (docs/extending.md): the masks, unchanged."""

from karf_engine.segmentation.labels import LabelledSurface, LabelProblem, vote_on_surface


def exact(problem: LabelProblem) -> LabelledSurface:
    """The labels of the masks' votes, without propagation."""
    return vote_on_surface(problem)
