"""The ways from masks to labels of the surface, by the names of `segmentation.labels`.

A new one is a function from a `LabelProblem` to a `LabelledSurface`, and a call of `register_labels` or an entry point
`karf.labels` that is the function.
"""

from __future__ import annotations

from collections.abc import Callable

from ..errors import BadRequest
from ..io.arguments import check_choice, checked
from ..io.plugins import load_plugin, plugin_names
from ..project.settings import LABEL_KINDS
from .labels import LabelledSurface, LabelProblem, label_surface, vote_on_surface

PLUGINS = "karf.labels"


LabelSolver = Callable[[LabelProblem], LabelledSurface]

SOLVERS: dict[str, LabelSolver] = {}


@checked
def register_labels(name: str, solve: LabelSolver) -> None:
    """Make a way to labels known: to the setting `segmentation.labels`.

    Raises:
        TypeError: An argument is of another type.
        BadRequest: Another way has this name.
    """
    if SOLVERS.setdefault(name, solve) is not solve:
        raise BadRequest(f"There are other labels {name!r}.", "Choose another name.")
    if name not in LABEL_KINDS:
        LABEL_KINDS.append(name)


def solve_labels(name: str, problem: LabelProblem) -> LabelledSurface:
    """Labels of the surface.

    Raises:
        BadRequest: No way has this name.
        DataError: No point stands for any of the objects.
        MissingDependency: An installed package brings it, and cannot be loaded.
    """
    if name not in SOLVERS and name in plugin_names(PLUGINS):
        register_labels(name, load_plugin(PLUGINS, name))
    check_choice("segmentation.labels", name, tuple(SOLVERS))
    return SOLVERS[name](problem)


register_labels("surface", label_surface)
register_labels("masks", vote_on_surface)
register_labels("votes", vote_on_surface)
