"""A way to labels of one's own: the masks are taken as they are (docs/extending.md)."""

from karf_engine.segmentation.label_solvers import LabelProblem
from karf_engine.segmentation.labels import LabelledSurface, vote_on_surface


def exact(problem: LabelProblem) -> LabelledSurface:
    """The labels that the masks' votes say, without propagation."""
    return vote_on_surface(problem.objects, problem.points, problem.votes, problem.constraints, problem.emit)
