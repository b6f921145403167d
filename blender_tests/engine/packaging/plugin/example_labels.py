"""A way to labels of one's own: the masks are taken as they are (docs/extending.md)."""

from karf_engine.segmentation.labels import LabelledSurface, LabelProblem, vote_on_surface


def exact(problem: LabelProblem) -> LabelledSurface:
    """The labels that the masks' votes say, without propagation."""
    return vote_on_surface(problem)
